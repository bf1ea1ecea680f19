"""Writing a page to a file."""

from __future__ import annotations

from pathlib import Path

from graspsense.recording.atomic_file import write_or_replace
from graspsense.report.html import Page


def write_html(path: Path, page: Page) -> None:
    """Write a page, replacing an older one. Raises SaveFailed."""
    write_or_replace(path, page.html().encode("utf-8"), make_folder=True)
