"""The picture of one grasp: pad forces, gap and phases over time, beside the features and the prediction."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.errors import ConfigError, PluginUnavailable
from graspsense.core.signals import Phase
from graspsense.core.units import display_unit
from graspsense.report.confusion import MATPLOTLIB_HINT

if TYPE_CHECKING:
    from graspsense.core.trace import Floats, Integers, Trace
    from graspsense.core.trial import Trial

DPI: Final = 120
"""Pixels per inch: the picture is 1020 pixels wide and stays readable when a page scales it to 800."""
BEFORE_CONTACT_S: Final = 0.8
"""How much of the approach is shown where time is in seconds: the rest is motion through free air."""
PHASE_COLOURS: Final = {Phase.APPROACH: "#e9eff6", Phase.SQUEEZE: "#fbdcb4", Phase.HOLD: "#c9e6cf"}
OTHER_PHASE: Final = "#f3f3f3"
LEAST_NAMED: Final = 0.05
"""A phase that lasts less than this share of the grasp is shaded but not named."""
COLUMNS: Final = 40
"""Characters in a line of text beside the curves."""
LEFT, RIGHT, GAP = "#0b5fa5", "#b3400a", "#3d3d3d"


def require_picture(path: Path) -> None:
    """Check before a grasp that its picture can be written to `path`.

    Raises PluginUnavailable without matplotlib, ConfigError for another suffix than `.png` or a missing folder.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise PluginUnavailable(f"{MATPLOTLIB_HINT} ({error})") from error
    if path.suffix.lower() != ".png":
        raise ConfigError(f"the picture is a PNG file: name it {path.with_suffix('.png')}, not {path}")
    if not path.parent.is_dir():
        raise ConfigError(f"the picture cannot be written to {path}: there is no folder {path.parent}")


def grasp_png(trial: Trial, path: Path) -> None:
    """Draw a trial as a PNG file. Raises as `require_picture`, and ConfigError where `path` cannot be written."""
    require_picture(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 4.4), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0))
    force: Any = figure.add_subplot(grid[0, 0])
    gap: Any = figure.add_subplot(grid[1, 0], sharex=force)
    words: Any = figure.add_subplot(grid[:, 1])
    trace = trial.trace
    contact = _contact(trace)
    zero = 0.0 if contact is None else contact
    start = 0
    if contact is not None and trace.units["t"] == "s":
        start = int(np.searchsorted(trace.t_s, contact - BEFORE_CONTACT_S))
    t = trace.t_s[start:] - zero
    force.plot(t, trace.force_left_n[start:], color=LEFT, lw=1.6, label="left pad")
    force.plot(t, trace.force_right_n[start:], color=RIGHT, lw=1.6, ls="--", label="right pad")
    force.set_ylabel(f"force, {trace.units['force_left']}")
    # Noise alone does not fill the axis.
    force.set_ylim(top=max(force.get_ylim()[1], 1.0))
    force.legend(loc="upper left", fontsize=8, framealpha=0.9)
    force.tick_params(labelbottom=False)
    shown, factor = display_unit(trace.units["gap"])
    gap.plot(t, factor * trace.gap_m[start:], color=GAP, lw=1.6)
    gap.set_ylabel(f"gap, {shown}")
    gap.set_xlabel(f"{'time' if contact is None else 'time since contact'}, {trace.units['t']}")
    for axes in (force, gap):
        _shade_phases(axes, t, trace.phase[start:], named=axes is force)
        axes.margins(x=0.0)
        axes.grid(color="white", lw=0.8)
        axes.set_axisbelow(True)
    words.set_axis_off()
    lines = [
        part for line in _words(trial) for part in wrap(line, COLUMNS, subsequent_indent="      ") or [""]
    ]
    words.text(0.0, 1.0, "\n".join(lines), va="top", fontsize=8.5, linespacing=1.45)
    try:
        figure.savefig(path, format="png")
    except OSError as error:
        raise ConfigError(f"the picture cannot be written to {path}: {error.strerror}") from error


def _contact(trace: Trace) -> float | None:
    """Return when both pads touched, where the phase changes from approach to squeeze; None if they never did."""
    squeezed = np.flatnonzero(trace.phase == int(Phase.SQUEEZE))
    return float(trace.t_s[squeezed[0]]) if len(squeezed) else None


def _shade_phases(axes: Any, t: Floats, phases: Integers, *, named: bool) -> None:
    """Shade each phase behind the lines; `named`: write its name above it."""
    if len(t) == 0:
        return
    starts = [0, *(np.flatnonzero(np.diff(phases)) + 1).tolist()]
    for start, end in zip(starts, [*starts[1:], len(t) - 1], strict=True):
        phase, begin, stop = Phase(int(phases[start])), float(t[start]), float(t[end])
        axes.axvspan(begin, stop, color=PHASE_COLOURS.get(phase, OTHER_PHASE), lw=0.0, zorder=0)
        if named and stop - begin >= LEAST_NAMED * float(t[-1] - t[0]):
            axes.text(
                0.5 * (begin + stop),
                1.02,
                phase.name.lower(),
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=8,
            )


def _words(trial: Trial) -> list[str]:
    """Return outcome, features and prediction, line by line."""
    features, prediction = trial.features, trial.prediction
    lines = [f"Outcome: {trial.outcome.words}", "", "Features"]
    for name, value, unit in zip(features.names, features.values, features.units, strict=True):
        shown, factor = display_unit(unit)
        number = "missing" if value != value else f"{factor * value:.4g} {'' if shown == '1' else shown}"
        lines.append(f"   {name} = {number.rstrip()}")
    lines.append("")
    if prediction is None:
        return [*lines, "Prediction: none, the pipeline has no classifier"]
    certainty = f" ({prediction.certainty_in_words})" if prediction.certainty_in_words else ""
    lines += ["Prediction", f"   {prediction.label}{certainty}", "", "because"]
    lines += [f"   {step}" for step in prediction.because]
    if trial.report.get("simulated"):
        lines += ["", "simulated gripper and object"]
    return lines
