"""The page of an identified object: data and fit, candidates, pairs of parameters, and the predictive check."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.identification import (
    Identification,
    IdentifiedParameter,
    PredictiveCheck,
    SqueezeFit,
    held_out_in_words,
    repeatability,
)
from graspsense.report.found_table import FoundTable
from graspsense.report.html import Page, Section, bullets, figure, panels, paragraph, table
from graspsense.report.svg import INKS, QUIET, WIDTH, AxisScale, Picture, reaching

MAX_FITS: Final = 12
MAX_PAIRS: Final = 6
MAX_SHOWN: Final = 300
LEFT: Final = 46.0
RIGHT: Final = WIDTH - 8.0
BINS: Final = 24


def identification_page(result: Identification, scene: str) -> Page:
    """Return the page of an identification; `scene` is the name of the scene file, empty if none was written."""
    relative = [fit.residual for fit in result.fits]
    chosen = next(candidate.terms for candidate in result.candidates if candidate.chosen)
    what = result.label or "the object"
    held_out = f"Held out: {held_out_in_words(result.held_out)}. " if result.held_out else ""
    parameters, candidates, undetermined = identification_tables(result)
    return Page(
        kind="Identified object",
        title=what,
        question="Which terms and numbers describe the recorded squeezes?",
        headline=f"{what}: {chosen}",
        answer=(
            f"{len(result.fits)} squeezes, fitted to {100.0 * float(np.mean(relative)):.2g} % of the peak force (rms). "
            f"{_differ(result.fits)}{held_out}"
            + (f"The scene is {scene}." if scene else "No scene was written.")
        ),
        beside=bullets(result.refusals, "warning") + bullets(result.notes),
        sections=(
            parameters.section(),
            undetermined.section(),
            Section(id="fits", title="Data and fit", body=_fits(result.fits)),
            candidates.section(),
            Section(id="pairs", title="Pairs of parameters", body=_pairs(result)),
            Section(id="check", title="Simulated beside recorded squeezes", body=_checks(result.checks)),
        ),
    )


def _differ(fits: Sequence[SqueezeFit]) -> str:
    if len(fits) < 2:
        return ""
    return f"Among themselves, the squeezes differ by {100.0 * repeatability(fits):.2g} % of the peak. "


def identification_tables(result: Identification) -> tuple[FoundTable, FoundTable, FoundTable]:
    """Return the parameters, the candidates, and what the recordings do not determine."""
    parameters = FoundTable(
        id="parameters",
        title="Parameters",
        header=("parameter", "value", "unit", "90 % interval", "basis"),
        rows=tuple(
            (parameter.name, f"{parameter.value:.4g}", parameter.unit, _interval(parameter), parameter.basis)
            for parameter in result.parameters
        ),
    )
    candidates = FoundTable(
        id="candidates",
        title="Candidates",
        header=("candidate", "parameters", "error", "fit", "verdict"),
        rows=tuple(
            (
                candidate.terms,
                str(candidate.parameters),
                percent_of_peak(candidate.error),
                percent_of_peak(candidate.fit_error),
                candidate.verdict,
            )
            for candidate in result.candidates
        ),
        note="The error is the rms residual over the peak force, of other recordings with a width and a stiffness of "
        "their own, or of other stretches of a single recording; the fit is that of the recordings themselves. The "
        "simplest candidate is chosen whose error is not larger than the least by more than a standard error of the "
        "difference.",
        numbers=1,
        verdicts=(4,),
    )
    undetermined = FoundTable(
        id="open",
        title="Not determined by these recordings",
        header=("what", "why", "what would determine it"),
        rows=tuple((quantity.what, quantity.reason, quantity.remedy) for quantity in result.undetermined),
        note="" if result.undetermined else "These recordings determine every number of the scene.",
    )
    return parameters, candidates, undetermined


def _fits(fits: Sequence[SqueezeFit]) -> str:
    figures = [
        figure(_fit_picture(fit), f"{fit.name}: rms {1e3 * fit.rms_n:.0f} mN") for fit in fits[:MAX_FITS]
    ]
    left = len(fits) - MAX_FITS
    remark = paragraph(f"{left} more squeezes are not drawn.") if left > 0 else ""
    return panels(figures) + remark


def _fit_picture(fit: SqueezeFit) -> str:
    """Return force over time, measured and fitted, above the residual."""
    picture = Picture(height=268.0)
    t = fit.t_s - fit.t_s[0]
    residual = fit.measured_n - fit.fitted_n
    x = reaching(t.tolist(), LEFT, RIGHT)
    y = reaching([*fit.measured_n.tolist(), *fit.fitted_n.tolist()], 140.0, 22.0, zero=True)
    below = reaching([*residual.tolist(), 0.0], 215.0, 178.0)
    with picture.axes(x, y, "", "force, N"):
        picture.dots(_points(x, y, t, fit.measured_n), INKS[0], "measured")
        picture.line(_points(x, y, t, fit.fitted_n), INKS[1], name="fitted")
    with picture.axes(x, below, "time, s", "measured − fitted, N"):
        picture.dots(_points(x, below, t, residual), INKS[0], "residual")
    picture.text(RIGHT - 56.0, 262.0, "● measured", anchor="end", ink=INKS[0])
    picture.text(RIGHT, 262.0, "— fitted", anchor="end", ink=INKS[1])
    return picture.svg(f"Force over time of {fit.name}, measured and fitted, and the residual", "s")


def _points(
    x: AxisScale, y: AxisScale, xs: NDArray[np.float64], ys: NDArray[np.float64]
) -> list[tuple[float, float]]:
    return [(x(float(a)), y(float(b))) for a, b in zip(xs, ys, strict=True)]


def _pairs(result: Identification) -> str:
    names = [parameter.name for parameter in result.parameters if "." in parameter.name]
    draws = result.draws
    if draws is None or len(names) < 2 or draws.shape[1] != len(names):
        return paragraph("There is one free parameter, so there are no pairs.")
    correlation = np.corrcoef(np.log(draws), rowvar=False)
    order = sorted(combinations(range(len(names)), 2), key=lambda pair: -abs(correlation[pair]))
    figures = []
    for a, b in order[:MAX_PAIRS]:
        picture = Picture(height=210.0)
        x = reaching(draws[:, a].tolist(), LEFT, RIGHT)
        y = reaching(draws[:, b].tolist(), 170.0, 22.0)
        with picture.axes(x, y, names[a], names[b]):
            picture.dots(_points(x, y, draws[:MAX_SHOWN, a], draws[:MAX_SHOWN, b]), INKS[0], "draw")
        words = f"{names[a]} and {names[b]}: correlation {correlation[a, b]:+.2f}"
        figures.append(figure(picture.svg(words), words))
    return paragraph("Draws of the identified values, the most correlated pairs first.") + panels(figures)


def _checks(checks: Sequence[PredictiveCheck]) -> str:
    if not checks:
        return paragraph("No squeezes were simulated.")
    rows = [
        (
            f"{check.statistic}{f', {check.unit}' if check.unit else ''}",
            f"{np.mean(check.recorded):.4g}",
            f"{np.quantile(check.simulated, 0.05):.4g} to {np.quantile(check.simulated, 0.95):.4g}",
            f"{check.p:.2f}",
        )
        for check in checks
    ]
    note = paragraph(
        "New squeezes were simulated on the recorded paths of the gap, of objects drawn from the identified values and "
        "spreads. p is the share of simulated sets whose mean is at least the recorded one: near 0 or 1, the scene "
        "does not describe the recordings."
    )
    header = ("statistic", "recorded, mean", "simulated, 90 %", "p")
    return note + table("Predictive check", header, rows, 1) + panels([_histogram(check) for check in checks])


def _histogram(check: PredictiveCheck) -> str:
    values = np.array(check.simulated)
    counts, edges = np.histogram(values[np.isfinite(values)], BINS)
    picture = Picture(height=170.0)
    x = reaching([*edges.tolist(), *check.recorded], LEFT, RIGHT)
    y = reaching([0.0, *counts.tolist()], 128.0, 22.0, zero=True)
    with picture.axes(
        x, y, f"{check.statistic}{f', {check.unit}' if check.unit else ''}", "simulated squeezes"
    ):
        for k, count in enumerate(counts.tolist()):
            left, right = x(float(edges[k])), x(float(edges[k + 1]))
            picture.box(left, y(count), right - left, y(0.0) - y(count), INKS[0], QUIET)
        for value in check.recorded:
            picture.mark(x(value), y(0.0) - 4.0, INKS[1], 2, words=f"recorded {value:.4g}")
    words = f"{check.statistic}: bars are simulated squeezes, marks recorded ones; p = {check.p:.2f}"
    return figure(picture.svg(words), words)


def _interval(parameter: IdentifiedParameter) -> str:
    return "-" if math.isnan(parameter.low) else f"{parameter.low:.4g} to {parameter.high:.4g}"


def percent_of_peak(share: float) -> str:
    """Return a share of the peak force in per cent; a dash where there is none."""
    return "-" if math.isnan(share) else f"{100.0 * share:.2f} %"
