"""The error of a simulator against its processor time, as a table and as a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from attrs import asdict, frozen

from graspsense.report.write import new_figure, write_picture

if TYPE_CHECKING:
    from graspsense.core.components.roles import SimulationVariant

HEADER: Final = ("METHOD", "FIDELITY", "STEP OR ACCURACY", "MS A GRASP", "SET-UP, S")
PEAK: Final = "peak force"
TRACE: Final = "force trace, rms"
LEAST_ERROR: Final = 1e-9
"""Smaller errors are drawn at this value, because a logarithmic axis cannot show 0."""


@frozen(kw_only=True)
class VariantPoint:
    """The errors of one variant and its processor time, both measured on the same grasps.

    `seconds` is the processor time for one grasp, without set-up and compilation. `errors` are the largest errors over
    all grasps, by quantity, and infinite if a feature is missing that the reference has. `setup_s` is the additional
    time of the first grasps, for compiling or for loading compiled code. `failure` is the reason why there are no
    errors, or why grasps ended otherwise than in the reference.
    """

    method: str
    fidelity: str
    step: str
    role: str
    seconds: float
    setup_s: float
    errors: Mapping[str, float]
    failure: str = ""

    @classmethod
    def measured(cls, variant: SimulationVariant, **figures: Any) -> VariantPoint:
        """Return what was measured of a variant; `figures` has the other fields."""
        return cls(
            method=variant.method,
            fidelity=variant.fidelity,
            step=variant.step,
            role=variant.role,
            **figures,
        )

    @property
    def curve(self) -> str:
        """Name of the curve that the point belongs to."""
        return f"{self.method}, {self.fidelity}"


@frozen(kw_only=True)
class SimulationTrade:
    """All variants of a simulated gripper, measured on the same grasps."""

    gripper: str
    scenes: tuple[str, ...]
    seeds: tuple[int, ...]
    quantities: tuple[str, ...]
    points: tuple[VariantPoint, ...]
    made: Mapping[str, str]

    def as_json(self) -> dict[str, Any]:
        """Return the trade-off as values for JSON."""
        return asdict(self)


def simulation_rows(trade: SimulationTrade) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the header and the rows of the table: time, set-up and the largest error of each quantity."""
    header = (*HEADER, *(name.upper() for name in trade.quantities), "")
    rows = []
    for point in trade.points:
        errors = [_short(point.errors.get(name, math.nan)) for name in trade.quantities]
        note = point.failure or ("the reference" if point.role == "reference" else "")
        seconds, setup = (
            f"{v:.3g}" if math.isfinite(v) else "-" for v in (1e3 * point.seconds, point.setup_s)
        )
        rows.append((point.method, point.fidelity, point.step, seconds, setup, *errors, note))
    return header, rows


def simulation_markdown(trade: SimulationTrade, picture: str | None = None) -> str:
    """Return the page: the table of variants, and the picture if there is one."""
    made = ", ".join(f"{key} {value}" for key, value in trade.made.items())
    header, rows = simulation_rows(trade)
    lines = [
        "# Accuracy and time of the simulator",
        "",
        "Written by `graspsense tradeoff simulation`. All grasps are simulated.",
        "",
        f"{len(trade.scenes)} scenes ({', '.join(trade.scenes)}), {len(trade.seeds)} seeds each, ideal sensors, one "
        "thread. Errors and processor times are of the same grasps. An error is the largest over all grasps, relative "
        "to the value of the reference, or to 1 mm, 1 N, 50 ms, 1 mm/s or 1 N/s if the value is smaller.",
        f"Measured with: {made}.",
        "",
        *([f"![Error against time]({picture})", ""] if picture else []),
        f"| {' | '.join(header)} |",
        f"|{'---|' * len(header)}",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
    return "\n".join(lines) + "\n"


def simulation_png(trade: SimulationTrade, path: Path) -> None:
    """Draw one panel for each quantity.

    Raises PluginUnavailable without matplotlib, ConfigError if the file cannot be written.
    """
    names = trade.quantities
    panels = len(names)
    columns = 3
    rows = -(-panels // columns)
    figure = new_figure(4.6 * columns, 3.5 * rows + 1.3)
    axes: Any = figure.subplots(rows, columns, squeeze=False).ravel()
    handles: dict[str, Any] = {}
    for ax, name in zip(axes, names, strict=False):
        handles.update(_draw_curves(ax, trade, name))
        _prepare(ax, name)
    for ax in axes[panels:]:
        ax.set_axis_off()
    failed = [p for p in trade.points if p.failure]
    setup = max((p.setup_s for p in trade.points if math.isfinite(p.setup_s)), default=0.0)
    figure.suptitle(
        f"Simulated grasps ({', '.join(trade.scenes)}): error against processor time, one thread\n"
        f"without set-up and compilation, which took at most {setup:.3g} s; "
        f"{len(failed)} of {len(trade.points)} failed" + (" (crosses)" if failed else ""),
        fontsize=10,
    )
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize=8)
    write_picture(path, figure)


def _draw_curves(ax: Any, trade: SimulationTrade, quantity: str) -> dict[str, Any]:
    """Draw the error of one quantity against time, one curve for each method; return the lines for the legend."""
    handles = {}
    for k, curve in enumerate(dict.fromkeys(p.curve for p in trade.points if p.role == "curve")):
        points = [p for p in trade.points if p.curve == curve and p.role == "curve" and p.seconds > 0.0]
        good = [p for p in points if math.isfinite(p.errors.get(quantity, math.nan))]
        (handles[curve],) = ax.plot(
            [1e3 * p.seconds for p in good],
            [max(p.errors[quantity], LEAST_ERROR) for p in good],
            marker="os^vDP*X"[k % 8],
            color=f"C{k}",
            ms=4,
            lw=1.2,
        )
        for p in points:
            if p not in good:
                # A run without a result has an infinite error, which is drawn on the upper edge.
                ax.plot(
                    1e3 * p.seconds,
                    1.0,
                    marker="x",
                    color=f"C{k}",
                    ms=9,
                    transform=ax.get_xaxis_transform(),
                )
    return handles


def _prepare(ax: Any, title: str) -> None:
    """Prepare axes for errors against the time of a grasp."""
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_title(title, fontsize=9)
    ax.set_xlabel("ms a grasp", fontsize=8)
    ax.set_ylabel("error, relative", fontsize=8)
    ax.tick_params(labelsize=7, which="both")
    ax.grid(True, which="major", lw=0.3)


def _short(error: float) -> str:
    return "-" if math.isnan(error) else ("inf" if math.isinf(error) else f"{error:.1e}")
