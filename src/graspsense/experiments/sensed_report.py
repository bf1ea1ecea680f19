"""Recognition and distributions of features of a simulator's variants against their time, as text and as a picture."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from graspsense.experiments.sensed import TIME_MARGIN
from graspsense.report.simulation import axes_of, markdown_table
from graspsense.report.write import new_figure, write_picture

if TYPE_CHECKING:
    from graspsense.experiments.sensed import SensedPoint, SensedTrade

HEADER: Final = (
    "METHOD",
    "FIDELITY",
    "STEP OR ACCURACY",
    "MS A GRASP",
    "RECOGNISED",
    "POINTS FROM REFERENCE",
)
LEAST_DISTANCE: Final = 1e-4
"""Smaller distances are drawn at this value."""


def sensed_rows(trade: SensedTrade) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the header and one row for each variant; of a distance, the upper end of its interval is in brackets."""
    features = tuple(distance.feature.upper() for distance in trade.points[0].distances)
    rows = [
        (
            point.method,
            point.fidelity,
            point.step,
            f"{1e3 * point.seconds:.3g}",
            f"{100 * sum(point.rates) / len(point.rates):.1f} %",
            _difference(point),
            *(f"{distance.distance:.1e} ({distance.upper:.1e})" for distance in point.distances),
        )
        for point in trade.points
    ]
    return (*HEADER, *features), rows


def _difference(point: SensedPoint) -> str:
    if point.role == "reference":
        return "the reference"
    test = point.equivalence
    if test is None:
        return "-"
    low, high = test.interval
    words = "equivalent" if test.is_equivalent else "not shown to be equivalent"
    return f"{100 * test.difference:+.2f} ({100 * low:+.2f} to {100 * high:+.2f}), {words}"


def conclusion(trade: SensedTrade) -> str:
    """Return the coarsest equivalent variant in words."""
    tests = [point.equivalence for point in trade.points if point.equivalence is not None]
    if not tests:
        return "With one seed, no test of equivalence is possible: give two seeds or more."
    margin, least = f"{100 * tests[0].margin:g} points", min(test.power for test in tests)
    best = trade.coarsest
    sentence = (
        f"Take {best.name}, {1e3 * best.seconds:.3g} ms a grasp: its recognition is equivalent to that of the "
        f"reference within {margin}. No equivalent variant is faster by more than {100 * (TIME_MARGIN - 1):.0f} %, "
        "below which times are not told apart, and of those it is the nearest to the reference."
        if best is not None
        else f"With {len(trade.seeds)} seeds, no variant is shown to be equivalent to the reference within {margin}."
    )
    return (
        f"{sentence} The power of the weakest test is {least:.2g}: with this probability it shows that equal rates are "
        "equivalent."
    )


def about(trade: SensedTrade) -> str:
    """Return what was measured, in words."""
    return (
        f"{len(trade.seeds)} seeds, each with {trade.grasps} grasps for training and as many for testing "
        f"({', '.join(trade.objects)}), sensor {trade.sensor}, classifier {trade.classifier}. A classifier is trained "
        "on grasps of the variant and tested on grasps of the reference. Rates are compared with those of a classifier "
        "trained on the reference, by two one-sided tests, corrected for all variants. Distances of distributions are "
        "Wasserstein distances of all grasps of a label in standard deviations of the reference, the mean over labels; "
        "in brackets the upper end of the one-sided 95 % interval."
    )


def sensed_markdown(trade: SensedTrade) -> list[str]:
    """Return the section of the page."""
    return [
        "## Recognition and distributions",
        "",
        about(trade),
        "",
        conclusion(trade),
        "",
        *markdown_table(*sensed_rows(trade)),
        "",
    ]


def sensed_png(trade: SensedTrade, path: Path) -> None:
    """Draw recognition and the distances against time.

    Raises PluginUnavailable without matplotlib, ConfigError if the file cannot be written.
    """
    figure = new_figure(11.0, 5.2, dpi=100)
    left, right = figure.subplots(1, 2)
    _draw_rates(left, trade)
    _draw_distances(right, trade)
    figure.suptitle(
        f"Simulated grasps, sensor {trade.sensor}, {len(trade.seeds)} seeds of {trade.grasps} grasps",
        fontsize=10,
    )
    write_picture(path, figure)


def _draw_rates(ax: Any, trade: SensedTrade) -> None:
    """Draw the rate of each variant less that of the reference, with the interval of its tests and the margin."""
    axes_of(ax, "recognition, trained on the variant, tested on the reference", "points from the reference")
    ax.set_yscale("linear")
    for k, point in enumerate(trade.points):
        test = point.equivalence
        if test is None:
            ax.axvline(
                1e3 * point.seconds, color="0.5", lw=1.0, ls=":", label=f"{point.name} (the reference)"
            )
            continue
        ends = [
            [100.0 * (test.difference - test.interval[0])],
            [100.0 * (test.interval[1] - test.difference)],
        ]
        ax.errorbar(
            1e3 * point.seconds,
            100.0 * test.difference,
            yerr=ends,
            marker="os^vDP*X"[k % 8],
            color=f"C{k % 10}",
            ms=5,
            capsize=2,
            label=point.name,
        )
        ax.axhspan(-100.0 * test.margin, 100.0 * test.margin, color="0.93", zorder=0, lw=0)
    ax.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _draw_distances(ax: Any, trade: SensedTrade) -> None:
    """Draw the upper end of the distance of each feature against time, sorted by time."""
    axes_of(ax, "distance of the distributions, upper end at 95 %", "standard deviations of the reference")
    points = [point for point in trade.points if point.role != "reference"]
    features = [distance.feature for distance in points[0].distances] if points else []
    for k, feature in enumerate(features):
        heights = [max(point.distances[k].upper, LEAST_DISTANCE) for point in points]
        heights = [height if math.isfinite(height) else 1.0 for height in heights]
        ax.plot(
            [1e3 * point.seconds for point in points],
            heights,
            "os^vDP*X"[k % 8],
            color=f"C{k}",
            ms=5,
            label=feature,
        )
    ax.legend(fontsize=7, loc="best")
