"""The names of a public module, imported when they are first used.

Listing plugins and printing help therefore load neither numpy nor a driver. Type checkers read a stub beside the
module, which is generated from the same table:

    python -c "import graspsense as m; print(m.PUBLIC.stub())" > src/graspsense/__init__.pyi
    for door in plugin gripper classifier testing experiment simulator; do
        python -c "import graspsense.${door}_api as m; print(m.PUBLIC.stub())" > src/graspsense/${door}_api.pyi; done

A test compares the stubs with the tables.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

Table = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What names are for, the module that defines them, and the names.

A module is one of graspsense: `core.values.trace`.
"""


class LazyNames:
    """The names that the module `module` offers. The module gets the functions by which Python finds and lists them."""

    def __init__(self, module: str, table: Table) -> None:
        self.module, self.table = module, table
        self._home_of: Final = {
            name: home for homes in table.values() for home, names in homes.items() for name in names
        }
        self.names: Final = sorted(self._home_of)
        attributes = vars(sys.modules[module])
        attributes |= {"__getattr__": self.load, "__dir__": lambda: sorted(attributes["__all__"])}

    def load(self, name: str) -> Any:
        """Import a name, and keep it in the module. Raises AttributeError if the module does not offer it."""
        if name not in self._home_of:
            raise AttributeError(f"module {self.module!r} has no attribute {name!r}")
        value = getattr(import_module(f"graspsense.{self._home_of[name]}"), name)
        setattr(sys.modules[self.module], name, value)
        return value

    def stub(self) -> str:
        """Return the text of the type stub: an import of each name, in the groups of the table."""
        lines = [
            f'"""Generated from the table of {self.module} by `core/components/lazy_names.py`: change the table."""'
        ]
        if hasattr(sys.modules[self.module], "__version__"):
            lines += ["", "__version__: str"]
        for purpose, homes in self.table.items():
            lines += ["", f"# {purpose}"]
            for home, names in homes.items():
                lines += [f"from graspsense.{home} import {name} as {name}" for name in names]
        return "\n".join(lines)
