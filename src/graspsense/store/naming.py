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


def as_source(text: str) -> str:
    """Return a source of trials or recordings with `store:` before the folder of a store; others as they are."""
    if not text.startswith(STORE):
        for name, mark, number in ((text, "", ""), text.rpartition("#")):
            folder = store_folder(name)
            if name and os.path.isfile(Path(folder).expanduser() / FILE):
                return f"{STORE}{folder}{mark}{number}"
    return text
