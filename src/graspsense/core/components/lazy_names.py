"""The names of a public module, imported when they are first used.

Listing plugins and printing help therefore load neither numpy nor a driver. The names stand in the type stub beside the
module, which type checkers read too: an import of each name, below a comment that says what the names are for.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any, Final


class LazyNames:
    """The names in the stub of the module `module`. The module gets the functions by which Python finds and lists them.

    `groups` has, for each purpose, the names in their order, with the modules that define them.
    """

    def __init__(self, module: str) -> None:
        self.module = module
        self.groups: Final = _groups(_stub_of(module))
        self._home_of: Final = {name: home for names in self.groups.values() for name, home in names}
        self.names: Final = sorted(self._home_of)
        attributes = vars(sys.modules[module])
        attributes |= {"__getattr__": self.load, "__dir__": lambda: sorted(attributes["__all__"])}

    def load(self, name: str) -> Any:
        """Import a name, and keep it in the module. Raises AttributeError if the module does not offer it."""
        if name not in self._home_of:
            raise AttributeError(f"module {self.module!r} has no attribute {name!r}")
        value = getattr(import_module(self._home_of[name]), name)
        setattr(sys.modules[self.module], name, value)
        return value


def _stub_of(module: str) -> str:
    """Return the text of the type stub beside a module, which may be inside an archive."""
    spec: Any = sys.modules[module].__spec__
    text: bytes = spec.loader.get_data(spec.origin.removesuffix(".py") + ".pyi")
    return text.decode()


def _groups(stub: str) -> dict[str, list[tuple[str, str]]]:
    """Return the names that a stub imports, each with its module, by the comment above them."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for line in stub.splitlines():
        if line.startswith("# "):
            names = groups[line.removeprefix("# ")] = []
        elif line.startswith("from "):
            _, home, _, name, *_ = line.split()
            names.append((name, home))
    return groups
