"""Spreadsheets (XLSX, XLS, XLSB, ODS) as texts with a line for each row, read by python-calamine in another process."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Final

from graspsense.core.values.errors import ConfigError, PluginUnavailable, listed
from graspsense.sources.formats.reading_process import read_by

SPREADSHEET_SUFFIXES: Final = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
SPREADSHEET_HINT: Final = (
    'spreadsheets need python-calamine: install it, or save the sheet as "CSV UTF-8" (Excel) or "Text CSV" '
    "(LibreOffice).\n"
    '  in a clone: pip install -e ".[spreadsheets]"     published: pip install "graspsense[spreadsheets]"'
)


def spreadsheet_text(path: Path, start: str) -> str:
    """Return the visible sheet of a spreadsheet, with cells separated by tabs; with `start` all sheets.

    Of several sheets, each begins with a line `sheet NAME`. Raises PluginUnavailable without python-calamine,
    ConfigError also for several sheets without `start`, TooLarge, DataDamaged.
    """
    if importlib.util.find_spec("python_calamine") is None:
        raise PluginUnavailable(f"{path}: {SPREADSHEET_HINT}")
    names, _, text = read_by("spreadsheet_child.py", path, "a spreadsheet").partition("\n")
    sheets = json.loads(names)
    if len(sheets) > 1 and not start:
        raise ConfigError(
            f"{path} has {len(sheets)} sheets: {listed(sheets)}. Say in a manifest which is meant, "
            "start = '^sheet NAME$', or that each is a grasp, start = '^sheet (?P<label>.*)'; or hide the others"
        )
    return text
