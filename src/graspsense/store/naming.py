"""How a user names a store: by its folder, by `store:` and its folder, or by its SQLite file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from graspsense.store.opening import FILE

STORE: Final = "store:"


def store_folder(text: str | os.PathLike[str]) -> str:
    """Return the folder of a store, however it is named: `store:trials`, `trials`, `trials/store.sqlite`.

    >>> store_folder("store:trials")
    'trials'
    """
    name = os.fspath(text)
    if name.startswith(STORE) and not Path(name).exists():
        name = name.removeprefix(STORE)
    path = Path(name).expanduser()
    return str(path.parent) if path.name == FILE and path.is_file() else name


def place_and_number(text: str) -> tuple[str, int | None]:
    """Return the two parts of `PLACE#NUMBER`, as of a trial of a store; the text itself and None if it has no number.

    >>> place_and_number("trials#12"), place_and_number("cup#b.toml")
    (('trials', 12), ('cup#b.toml', None))
    """
    place, _, number = text.rpartition("#")
    return (place, int(number)) if place and number.isdecimal() and len(number) <= 18 else (text, None)


def as_source(text: str) -> str:
    """Return a source of trials or recordings with `store:` before the folder of a store; others as they are."""
    if not text.startswith(STORE):
        for name, mark, number in ((text, "", ""), text.rpartition("#")):
            folder = store_folder(name)
            if name and os.path.isfile(Path(folder).expanduser() / FILE):
                return f"{STORE}{folder}{mark}{number}"
    return text
