"""Warnings of libraries during many fits, gathered to one line each with a count."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_LIBRARIES: Final = ("sklearn", "numpy", "scipy", "interpret", "pycatch22")


@contextmanager
def gathered_warnings(notes: list[str]) -> Iterator[None]:
    """Add one note for each different warning that is given inside, in place of showing it each time."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            counts = Counter(
                (in_words(warning.message, warning.category, warning.filename), warning.category)
                for warning in caught
            )
    for (words, category), n in counts.items():
        # What is given without a category is a sentence for the user, and means the same in every fit.
        notes.append(words if n == 1 or category is UserWarning else f"{words} ({n} times)")


def in_words(message: Warning | str, category: type[Warning], filename: str) -> str:
    """Return a warning in one line for a user; further lines of it are advice to programmers."""
    if category.__name__ == "ConvergenceWarning":
        return "a classifier was still improving when its iterations ended: more of them can raise its rate"
    sentence = next(iter(str(message).strip().splitlines()), "").rstrip(".: ")
    library = next((name for name in _LIBRARIES if name in Path(filename).parts), "")
    return f"{library} remarks: {sentence}" if library else sentence
