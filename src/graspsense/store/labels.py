"""What an operator says was grasped, as one word: `CLASS:STATE`, with `#N` behind it for the very thing."""

from __future__ import annotations

import re
from typing import Final

from graspsense.core.errors import ConfigError
from graspsense.core.features import UNKNOWN

_WORD: Final = re.compile(r"(?P<kind>[^\s:#,]+)(?P<state>:[^\s:#,]+)?(?P<number>#[^\s:#,]+)?")


def labels_of(word: str) -> dict[str, str]:
    """Return `label`, and `instance` where the word names the very thing: `can:full_open#2` is `can#2`.

    Raises ConfigError for what is no such word.
    """
    match = _WORD.fullmatch(word)
    if match is None:
        raise ConfigError(
            f"{word!r} is no label: write CLASS:STATE, as in can:full_open, and #2 behind it for the second can"
        )
    label = match["kind"] + (match["state"] or "")
    if match["kind"] == UNKNOWN:
        raise ConfigError(f"{UNKNOWN!r} is no label: it is the answer to a thing unlike any other")
    return {"label": label, **({"instance": match["kind"] + match["number"]} if match["number"] else {})}
