"""The drawing of a trace with matplotlib: forces, gap and fast channels over time, and the tactile arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from graspsense.core.values.fingers import FingerForce
from graspsense.core.values.trace import Floats, ImageTrace, Integers, SampleTrace, Trace
from graspsense.core.values.units import display_unit, without_underscores
from graspsense.report.moments import (
    OTHER_PHASE,
    PHASE_COLOURS,
    array_images,
    contact_time,
    images_at,
    moments,
    number_of_each,
    phase_spans,
    shown_from,
)
from graspsense.report.write import require_matplotlib, show_literally

LEAST_NAMED: Final = 0.05
"""A phase that lasts less than this share of the grasp is shaded but not named."""
AXIS_STYLES: Final = ("-", "--", ":", "-.")
LEFT, RIGHT, GAP = "#0b5fa5", "#b3400a", "#3d3d3d"


def plot(trace: Trace) -> tuple[Any, Any]:
    """Draw a trace in a new figure of pyplot and return its axes. Raises PluginUnavailable without matplotlib."""
    require_matplotlib()
    from matplotlib import pyplot

    arrays = {
        (name, side): images for name, sides in array_images(trace).items() for side, images in sides.items()
    }
    fast = {
        name: signal
        for name, signal in trace.signals.items()
        if isinstance(signal, SampleTrace) and len(signal.t_s)
    }
    heights = [2.2, 2.2, *[1.6] * len(fast), *[1.1] * len(arrays)]
    figure, rows = pyplot.subplots(
        len(heights), 1, figsize=(6.4, sum(heights)), layout="constrained", height_ratios=heights
    )
    force, gap, *others = rows
    gap.sharex(force)
    draw_trace(trace, force, gap)
    for axes, (name, signal) in zip(others, fast.items(), strict=False):
        axes.sharex(force)
        _draw_samples(trace, axes, name, signal)
    for axes, ((name, side), images) in zip(others[len(fast) :], arrays.items(), strict=True):
        title = f"{side} fingertip" if side else without_underscores(name)
        unit = trace.units.get(name, "")
        figure.colorbar(_draw_array(trace, axes, title, images), ax=axes, label=unit)
    show_literally(figure)
    return force, gap


def _draw_samples(trace: Trace, axes: Any, name: str, signal: SampleTrace) -> None:
    """Draw each axis of a fast channel over time."""
    zero = contact_time(trace) or 0.0
    begin = trace.t_s[shown_from(trace)]
    shown = signal.t_s >= begin
    for k, values in enumerate(signal.values[shown].T):
        # Lines of equal values are told apart by their dashes.
        axes.plot(signal.t_s[shown] - zero, values, ls=AXIS_STYLES[k % len(AXIS_STYLES)], lw=0.6)
    axes.set_ylabel(without_underscores(name), fontsize=8)


def _draw_array(trace: Trace, axes: Any, name: str, images: ImageTrace) -> Any:
    """Draw the cells of an array at contact, peak and rest, a row each; return the picture for its colour bar."""
    shown, relative = images_at(images, 1.0, moments(trace))
    shown = shown or {"last": number_of_each(images, images.cells[-1])}
    values = np.array(list(shown.values()))
    picture = axes.imshow(values, aspect="auto", interpolation="nearest", cmap="Blues")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_yticks(range(len(values)), list(shown))
    change = "change since before contact, by cell" if relative else "values, by cell"
    axes.set_title(f"{name}: {change}", fontsize=8, loc="left")
    return picture


def draw_trace(trace: Trace, force: Any, gap: Any, fingers: Sequence[FingerForce] = ()) -> None:
    """Draw the pad forces (the effort where there are none) and the gap into two axes of matplotlib with one time.

    The forces of `fingers`, which the gripper declares, are drawn beside those of the pads.
    """
    contact = contact_time(trace)
    zero = 0.0 if contact is None else contact
    start = shown_from(trace)
    t = trace.t_s[start:] - zero
    if np.isnan([trace.force_left_n, trace.force_right_n]).all():
        force.plot(t, trace.effort_n[start:], color=LEFT, lw=1.6, label="effort (no pad has a force)")
    else:
        force.plot(t, trace.force_left_n[start:], color=LEFT, lw=1.6, label="left pad")
        force.plot(t, trace.force_right_n[start:], color=RIGHT, lw=1.6, ls="--", label="right pad")
    for k, finger in enumerate(fingers):
        label = without_underscores(finger.finger)
        force.plot(t, trace.signals[finger.name][start:], color=f"C{k + 2}", lw=0.8, label=label)
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
        for phase, begin, end in phase_spans(t, trace.phase[start:]):
            axes.axvspan(begin, end, color=PHASE_COLOURS.get(phase, OTHER_PHASE), lw=0.0, zorder=0)
        axes.margins(x=0.0)
        axes.grid(color="white", lw=0.8)
        axes.set_axisbelow(True)
    _name_phases(force, t, trace.phase[start:])


def _name_phases(axes: Any, t: Floats, phases: Integers) -> None:
    """Write the name of each phase above it, as an axis: a title that the user sets stands above an axis."""
    least = LEAST_NAMED * float(t[-1] - t[0])
    named = [span for span in phase_spans(t, phases) if span[2] - span[1] >= least]
    above = axes.secondary_xaxis("top")
    above.set_xticks([0.5 * (begin + end) for _, begin, end in named], [span[0] for span in named])
    above.tick_params(length=0, pad=2, labelsize=8)
