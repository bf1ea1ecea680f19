"""Figures of matplotlib, and writing a page or a picture to a file."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any, Final

from graspsense.core.files.whole_file import write_or_replace, write_whole
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.report.html import Page

MATPLOTLIB_HINT: Final = (
    'a picture needs matplotlib: pip install "graspsense[plot]", or pip install matplotlib'
)


def require_matplotlib() -> None:
    """Raise PluginUnavailable without matplotlib."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise PluginUnavailable(f"{MATPLOTLIB_HINT} ({error})") from error


def new_figure(width_in: float, height_in: float, dpi: int = 120) -> Any:
    """Return a figure of matplotlib that no window shows. Raises PluginUnavailable without matplotlib."""
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_html(path: Path, page: Page) -> None:
    """Write a page, replacing an older one. Raises SaveFailed."""
    write_or_replace(path, page.html().encode(errors="backslashreplace"), make_folder=True)


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


def show_literally(figure: Any) -> None:
    """Let a figure of matplotlib show its texts as they are, but for the powers at logarithmic axes.

    A `$` in a label would begin a formula, which matplotlib would typeset or refuse.
    """
    from matplotlib.text import Text

    powers = {
        id(label)
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        if axis.get_scale() == "log"
        for label in axis.get_ticklabels(which="both")
    }
    for text in figure.findobj(Text):
        if id(text) not in powers:
            text.set_parse_math(False)
