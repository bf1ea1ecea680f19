"""Writing a page: whole, or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from graspsense.recording.recorder import NotKept
from graspsense.report.html import Page


def write_html(path: Path, page: Page) -> None:
    """Write a page, over an older one too. Raises NotKept."""
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(page.html(), encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise NotKept(f"{path} cannot be written: {error.strerror}") from error
