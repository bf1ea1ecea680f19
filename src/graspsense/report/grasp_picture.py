"""The picture of one grasp, beside its features and its prediction, and that of the channels of a file over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.fingers import fingers_of
from graspsense.core.values.trial import Trial
from graspsense.core.values.units import display_unit
from graspsense.report.trace_plot import draw_trace
from graspsense.report.write import new_figure, write_picture

DPI: Final = 120
"""Pixels per inch: the picture is 1020 pixels wide and stays readable when a page scales it to 800."""
COLUMNS: Final = 40
"""Characters in a line of text beside the curves."""
HEIGHT_IN: Final = 4.4
"""Height of the picture; a text of more lines makes it higher."""
LINE_IN: Final = 0.18
"""Height of a line of text."""


def grasp_png(trial: Trial, path: Path) -> None:
    """Draw a trial as a PNG file, with its text as the `Description` of the file.

    Raises PluginUnavailable without matplotlib, ConfigError where `path` cannot be written.
    """
    text = _words(trial)
    unbroken = [line.replace(" %", "\N{NO-BREAK SPACE}%") for line in text]
    lines = [part for line in unbroken for part in wrap(line, COLUMNS, subsequent_indent="      ") or [""]]
    height = max(HEIGHT_IN, LINE_IN * len(lines))
    figure = new_figure(8.5, height, DPI)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0))
    force: Any = figure.add_subplot(grid[0, 0])
    gap: Any = figure.add_subplot(grid[1, 0], sharex=force)
    words: Any = figure.add_subplot(grid[:, 1])
    draw_trace(trial.trace, force, gap, fingers_of(trial.device.channels))
    words.set_axis_off()
    words.text(0.0, 1.0, "\n".join(lines), va="top", fontsize=8.5, linespacing=1.45)
    write_picture(path, figure, metadata={"Description": "\n".join(text)})


def _words(trial: Trial) -> list[str]:
    """Return what was grasped, outcome, warnings, features and prediction with its set, line by line."""
    features, prediction = trial.features, trial.prediction
    reason = f": {trial.reason}" if trial.reason else ""
    labels, gripper = trial.run.labels, trial.run.settings.get("gripper", {})
    held = str(gripper.get("object") or labels.get("label") or "").strip() or "not known"
    lines = [f"Outcome: {trial.outcome.words}{reason}"]
    lines += [f"Object: {held.splitlines()[0]}, seed {trial.run.seed}"]
    lines += [f"Warning: {warning}" for warning in trial.warnings if warning != trial.reason]
    lines += ["", "Features"]
    rows, more = features.shown()
    for name, value, unit in rows:
        shown, factor = display_unit(unit)
        number = "missing" if value != value else f"{factor * value:.4g} {'' if shown == '1' else shown}"
        lines.append(f"   {name} = {number.rstrip()}")
    lines += [f"   {more}", ""] if more else [""]
    if prediction is None:
        return [*lines, "Prediction: none, the pipeline has no classifier"]
    certainty = f" ({prediction.certainty_in_words})" if prediction.certainty_in_words else ""
    lines += ["Prediction", f"   {prediction.label}{certainty}"]
    if prediction.set_in_words:
        lines += [f"   set: {prediction.set_in_words}"]
    lines += ["", "Because", *(f"   {reason.words}" for reason in prediction.because)]
    if prediction.warnings:
        lines += ["", *(f"Warning: {warning}" for warning in prediction.warnings)]
    if trial.report.get("simulated"):
        lines += ["", "simulated gripper and object"]
    return lines


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
