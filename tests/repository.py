"""Where the tests lie, and the repository that they belong to."""

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Final

TESTS: Final = Path(__file__).parent
ROOT: Final = TESTS.parent


def script_of_docs(name: str) -> ModuleType:
    """Return the module of a script in the folder `docs`."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
