"""Coverage of the intervals of `graspsense identify` from the scatter of a few squeezes, and of other rules.

    python plugins/identify/benchmarks/identify_intervals.py [--markdown FILE]

A parameter has a normal error in each squeeze: that of the fit, whose variance is known, and a difference between
objects. The scatter between n squeezes estimates the sum of both variances with n - 1 degrees of freedom. For each
rule, the table has the coverage of the 90 % interval of the mean where the objects are alike, and the least and the
largest coverage over all ratios of both variances. It is computed by quadrature over the distribution of the estimate.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import scipy
from identify import table_head, write_between
from numpy.typing import NDArray

from graspsense_identify.interval import normal, student
from graspsense_identify.spread import at_least

Floats = NDArray[np.float64]
Rule = Callable[[Floats, int], Floats]

SQUEEZES: Final = (2, 3, 5, 10)
RATIOS: Final = np.geomspace(1.0, 1e4, 41)
"""The variance of a squeeze over that of its fit: 1 where the objects are alike."""
POINTS: Final = 2_000
CLAIM: Final = 0.05


def larger(scatter: Floats, degrees: int) -> Floats:
    """Return the squared half width of `identify`, for scatters in units of the variance of the fit."""
    least = np.array([[(normal() / student(degrees)) ** 2]])
    return (
        np.array([at_least(np.array([[variance]]), least)[0, 0] for variance in scatter])
        * student(degrees) ** 2
    )


def scatter_only(scatter: Floats, degrees: int) -> Floats:
    """Student's t, whatever the error of the fit."""
    return student(degrees) ** 2 * scatter


def sum_of_both(scatter: Floats, degrees: int) -> Floats:
    """The error of the fit, and by Student's t what the scatter is beyond it."""
    return normal() ** 2 + student(degrees) ** 2 * np.maximum(scatter - 1.0, 0.0)


def after_test(scatter: Floats, degrees: int) -> Floats:
    """Student's t where Cochran's Q is improbable for objects that are alike, and otherwise the error of the fit."""
    differs = scatter * degrees > scipy.stats.chi2.ppf(1.0 - CLAIM, degrees)
    return np.where(differs, student(degrees) ** 2 * scatter, normal() ** 2)


RULES: Final[Mapping[str, Rule]] = {
    "the larger of both (`identify`)": larger,
    "the scatter alone": scatter_only,
    "the fit, and the scatter beyond it": sum_of_both,
    "the scatter where it is significant, or else the fit": after_test,
}


def coverage(rule: Rule, squeezes: int, ratio: float) -> float:
    """Return the coverage of a rule where a squeeze has this variance, in units of that of its fit."""
    degrees = squeezes - 1
    levels = (np.arange(POINTS) + 0.5) / POINTS
    scatter = ratio * scipy.stats.chi2.ppf(levels, degrees) / degrees
    within = 2.0 * scipy.stats.norm.cdf(np.sqrt(rule(scatter, degrees) / ratio)) - 1.0
    return float(np.mean(within))


def as_markdown() -> str:
    """Return the table: a row for each rule, a column for each number of squeezes."""
    lines = table_head(["90 % interval from", *(f"{n} squeezes" for n in SQUEEZES)])
    for name, rule in RULES.items():
        cells = []
        for n in SQUEEZES:
            all_of = [100.0 * coverage(rule, n, float(ratio)) for ratio in RATIOS]
            cells.append(f"{all_of[0]:.0f} % ({min(all_of):.0f} to {max(all_of):.0f})")
        lines.append("| " + " | ".join([name, *cells]) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--markdown", type=Path, help="write the table to this page")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    asked = parser.parse_args()
    if asked.short:
        print(f"{100.0 * coverage(larger, 3, 1.0):.1f} %")
        return
    table = as_markdown()
    print(table)
    if asked.markdown:
        write_between(asked.markdown, "interval rules", table)


if __name__ == "__main__":
    main()
