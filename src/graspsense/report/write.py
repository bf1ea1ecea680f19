"""Writing a page or a picture to a file."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

from graspsense.core.files.whole_file import write_whole
from graspsense.core.values.errors import ConfigError
from graspsense.recording.atomic_file import write_or_replace
from graspsense.report.html import Page
from graspsense.report.literal_text import show_literally


def write_html(path: Path, page: Page) -> None:
    """Write a page, replacing an older one. Raises SaveFailed."""
    write_or_replace(path, page.html().encode("utf-8"), make_folder=True)


def write_picture(path: Path, figure: Any, **how: Any) -> None:
    """Write a figure of matplotlib as a PNG file, with its texts as they are. Raises ConfigError if it cannot."""
    show_literally(figure)
    data = io.BytesIO()
    with warnings.catch_warnings():
        # A character that the font lacks is drawn as a box; matplotlib would print it.
        warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)
        figure.savefig(data, format="png", **how)
    try:
        write_whole(path, data.getvalue())
    except OSError as error:
        raise ConfigError(f"the picture cannot be written to {path}: {error.strerror}") from error
