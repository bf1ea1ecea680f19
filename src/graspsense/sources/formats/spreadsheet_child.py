"""Print the cells of a spreadsheet, a line with tabs for each row: `python spreadsheet_child.py FILE MOST_BYTES`.

A small file can name a text of megabytes a million times, so this is a program of its own, with a limit on its memory.
It imports nothing of graspsense. The first line has the names of the visible sheets with cells, in JSON. Of several
sheets, each begins with a line `sheet NAME`.
"""

from __future__ import annotations

import csv
import datetime
import io
import json
import sys
from typing import Any

import python_calamine

_LIBRARIES_BYTES = 500_000_000
"""Memory that the program takes without a file, with room."""
_WHOLE = 1e15
"""Numbers below it that are whole are written without a point."""


def cell_text(value: Any) -> str:
    """Return the text of a cell: times as ISO 8601, and durations in seconds."""
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < _WHOLE else repr(value)
    if isinstance(value, datetime.timedelta):
        return cell_text(value.total_seconds())
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return " ".join(str(value).split())


def main(path: str, most: int) -> None:
    """Print the visible sheets that have cells. Raises OverflowError for more bytes than this."""
    limit_memory(_LIBRARIES_BYTES + 2 * most)
    with python_calamine.load_workbook(path) as book:
        shown = python_calamine.SheetVisibleEnum.Visible
        visible = [each.name for each in book.sheets_metadata if each.visible == shown]
        sheets = {name: sheet for name in visible if (sheet := book.get_sheet_by_name(name)).start}
        most -= sys.stdout.write(json.dumps(list(sheets)) + "\n")
        for name, sheet in sheets.items():
            text = io.StringIO()
            if len(sheets) > 1:
                text.write(f"sheet {cell_text(name)}\n")
            writer = csv.writer(text, delimiter="\t", lineterminator="\n")
            for row in sheet.iter_rows():
                writer.writerow(map(cell_text, row))
                if text.tell() > most:
                    raise OverflowError
            most -= sys.stdout.write(text.getvalue())


def limit_memory(most: int) -> None:
    """Have the library end where it would take more memory, on systems that can."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


if __name__ == "__main__":
    try:
        main(sys.argv[1], int(sys.argv[2]))
    except (OverflowError, MemoryError):
        sys.exit(3)
