"""The picture of the channels of a file over time, with the squeezes that were found in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from graspsense.report.grasp_picture import DPI
from graspsense.report.write import new_figure, write_picture

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MOST_PANELS: Final = 8
PANEL_IN: Final = 1.3
"""Height of a panel."""


def channels_png(
    path: Path,
    series: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
    squeezes: Sequence[tuple[float, float]],
) -> None:
    """Draw times (s) and values of each channel as a PNG file; `squeezes` are shaded from begin to end (s).

    Raises PluginUnavailable without matplotlib, ConfigError where `path` cannot be written.
    """
    shown = list(series.items())[:MOST_PANELS]
    figure = new_figure(8.5, PANEL_IN * max(len(shown), 2), DPI)
    panels: Any = figure.subplots(max(len(shown), 1), 1, sharex=True, squeeze=False)
    for (name, (t_s, values)), panel in zip(shown, panels[:, 0], strict=False):
        panel.plot(t_s, values, linewidth=0.8)
        panel.set_ylabel(name[-24:], fontsize=7)
        for begin, end in squeezes:
            panel.axvspan(begin, end, alpha=0.2, color="tab:orange")
    panels[-1, 0].set_xlabel("time, s; shaded: squeezes that were found")
    write_picture(path, figure)
