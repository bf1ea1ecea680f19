"""Warnings of libraries during many fits, gathered to one line each with a count."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def gathered_warnings(notes: list[str]) -> Iterator[None]:
    """Add one note for each different warning that is given inside, in place of showing it each time."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            counts = Counter((one.category, _first_line(str(one.message))) for one in caught)
    for (category, message), n in counts.items():
        # What is given without a category is a sentence for the user, and means the same in every fit.
        times = f"{category.__name__}, {n} time{'' if n == 1 else 's'}: "
        notes.append(message if category is UserWarning else f"{times}{message}")


def _first_line(text: str) -> str:
    """Return the first line; later ones are advice to programmers."""
    return next(iter(text.strip().splitlines()), "").rstrip(".: ")
