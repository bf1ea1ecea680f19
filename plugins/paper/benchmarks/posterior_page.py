"""The page of a posterior, in Markdown, from the result of `plugins/paper/benchmarks/posterior.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from graspsense.evaluation.intervals import Z, percentage

TITLES: Final = {
    "table_2": "Table II: container class",
    "table_3_odwalla": "Table III: state of an Odwalla bottle",
    "table_3_naked": "Table III: state of a Naked bottle",
    "table_3_can": "Table III: state of a can",
    "table_3_water": "Table III: state of a water bottle",
    "confused": "Table II: share of the errors that confuse Odwalla and Naked",
    "p_first_separates": "section III.F: what p_first lacks to separate 90 % of every other pair",
    "p_first_does_not_separate": "section III.F: what p_first separates above 90 % of Odwalla and Naked",
    "f_steady_separates": "section III.F: what f_steady lacks to separate 90 % of Odwalla and Naked",
}
MIN_PARTICLES: Final = 5
"""Effective sample size below which no mean over particles, and no Bayes factor, is given."""
FOLLOWS: Final = "gain"
"""The prediction that is a difference of two others, and is not counted beside them."""
PINNED: Final = 0.5
"""Contraction from which on a figure counts as determined by the data."""
LEAST_SAMPLE: Final = 50.0
"""Effective sample size below which nothing is said of single figures and explanations."""
TOLD_APART: Final = 3.0
"""A Bayes factor counts as evidence if its whole interval is above this, or below its inverse."""
LEFT_OUT: Final = (
    "Wear between the squeezes of one placement. The explanation by the order of squeezes has only the centring of "
    "the container by the fingers.",
    "A pressure that is computed from the gas. The explanation by pressure changes the share on the cells in closed "
    "containers in proportion to the probing force.",
    "The nonlinearity of a cell in the controller's thresholds and in Figs. 4 to 6. In the features it is one of the "
    "figures.",
    "What people felt (Table VI), and Fig. 4 as a curve, which is printed without numbers.",
)


def page(result: Mapping[str, Any]) -> str:
    """Return the page."""
    parts = [
        "# A posterior of the simulator's uncertain figures",
        "All grasps are simulated, with models of the gripper and of the objects.\n"
        "Made by `python plugins/paper/benchmarks/posterior.py --out FOLDER` and "
        "`--markdown plugins/paper/benchmarks/results/posterior.md`, "
        f"{result['date']}, on {result['machine']}, pyABC {result['pyabc']}. "
        "`plugins/paper/benchmarks/results/posterior.json` has the result.",
        _answer(result),
        "## How it was made",
        _method(result),
        "## Priors, and what the data determine",
        _figures(result["figures"]),
        "## The data",
        _data(result),
        "## Predictions",
        _predictions(result),
        "## Explanations of the rise of the rate with the force",
        _explanations(result["explanations"], result["effective_sample_size"]),
        "## Is the inference calibrated?",
        _calibration(result["calibration"]),
        "## Left out",
        "\n".join(f"- {line}" for line in LEFT_OUT),
    ]
    return "\n\n".join(parts) + "\n"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _answer(result: Mapping[str, Any]) -> str:
    """Return what follows from the result, in a paragraph."""
    predicted = result["predictions"]
    tested = [
        figure
        for name, figure in predicted.items()
        if name != FOLLOWS and figure["published"] is not None and figure["deviation"] is not None
    ]
    met = [item for item in tested if _met(item)]
    if not predicted:
        return (
            "**Nothing was predicted in this run: Tables IV and V, section III.F and the points of each explanation "
            f"are not simulated.** {_evidence(result)} {_determined(result)}"
        )
    return (
        f"With the figures that the results at 20 N allow, {len(met)} of {len(tested)} published figures that were "
        "not used and have a standard deviation lie within the 95 % interval of one predicted replicate. "
        f"{_rise(result['explanations'], predicted[FOLLOWS])} {_evidence(result)} {_determined(result)}"
    )


def _rise(explanations: Mapping[str, Any], printed: Mapping[str, Any]) -> str:
    """Return how much of the rise of the rate with the force is explained."""
    rise, together = explanations["gain"], explanations["all"]["alone"]
    error = Z * printed["deviation"]
    text = (
        f"The paper's rate rises by {100 * printed['published']:.1f} points from 17 to 23 N (by its counts, 95 %: "
        f"{_points(printed['published'] - error)} to {_points(printed['published'] + error)}). Predicted are "
        f"{_points(rise['mean'])} points on average ({_points(rise['interval_of_mean'][0])} to "
        f"{_points(rise['interval_of_mean'][1])}), and {_points(rise['interval'][0])} to "
        f"{_points(rise['interval'][1])} for one replicate."
    )
    if together is None:
        return text
    best = max(explanations["of"].values(), key=lambda explanation: explanation["alone"]["mean"])
    most = max(together, best["alone"], key=lambda effect: float(effect["interval"][1]))
    left = printed["published"] - most["mean"]
    half = math.hypot(error, most["interval"][1] - most["mean"])
    return (
        f"{text} At full strength, the strongest explanation alone ({best['says']}) gives "
        f"{_points(best['alone']['mean'])} points and all together give {_interval(together)}. Unexplained are "
        f"{_points(left)} points ({_points(left - half)} to {_points(left + half)}, with the error of the printed "
        "counts)."
        if left - half > 0.0
        else f"{text} At full strength, all explanations together give {_interval(together)}."
    )


def _evidence(result: Mapping[str, Any]) -> str:
    """Return which explanations the data tell apart, if the sample is large enough to say so."""
    if result["effective_sample_size"] < LEAST_SAMPLE:
        return ""
    decided = []
    size = result["effective_sample_size"]
    for explanation in result["explanations"]["of"].values():
        factors = (explanation["at_20_n"], explanation["before_adjustment"])
        if any(_particles(factor, size) < MIN_PARTICLES for factor in factors):
            continue
        words = f"it that {explanation['says']} ({_factor(factors[0])}, before the adjustment {_factor(factors[1])})"
        if all(factor["bayes_factor_low"] > TOLD_APART for factor in factors):
            decided.append(f"for {words}")
        elif all(factor["bayes_factor_high"] < 1.0 / TOLD_APART for factor in factors):
            decided.append(f"against {words}")
    if not decided:
        return (
            "The results at 20 N neither favour nor exclude an explanation: no Bayes factor of at least "
            f"{MIN_PARTICLES} particles lies, with its interval and both before and after the adjustment, wholly above "
            f"{TOLD_APART:g} or below 1/{TOLD_APART:g}."
        )
    return f"The results at 20 N speak {'; '.join(decided)}; the other Bayes factors decide nothing."


def _determined(result: Mapping[str, Any]) -> str:
    """Return which figures the data determine, if the sample is large enough to say so."""
    size, explained = result["effective_sample_size"], result["explanations"]["of"]
    # Whether an explanation is there is judged by its Bayes factor.
    figures = {name: figure for name, figure in result["figures"].items() if name not in explained}
    if size < LEAST_SAMPLE:
        return (
            f"**This run is small: its effective sample size is {size:.1f}. It shows that the method works from end to "
            "end; contractions and Bayes factors of this size arise by chance, and nothing follows from them.**"
        )
    names = [name for name, figure in figures.items() if figure["contraction"] >= PINNED]
    if not names:
        return (
            f"None of the {len(figures)} figures is determined by these data (contraction of {PINNED:g} or more). The "
            f"effective sample size is {size:.0f}."
        )
    return (
        f"After the adjustment, the data determine {len(names)} of the {len(figures)} figures ({', '.join(names)}). "
        f"The effective sample size is {size:.0f}."
    )


def _met(prediction: Mapping[str, Any]) -> bool:
    low, high = prediction["interval"]
    return bool(low <= prediction["published"] <= high)


def _points(share: float) -> str:
    return f"{100 * share:+.1f}"


def _method(result: Mapping[str, Any]) -> str:
    numbers = " and ".join(map(str, result["simulations_by_proposal"]))
    return (
        "Approximate Bayesian computation with sequential Monte Carlo. Every simulation is one replicate of section "
        "III.E at 20 N (66, 41, 42 and 80 grasps of 12, 10, 12 and 16 containers) with C4.5 in ten folds. Its distance "
        "is the root of the sum of squared differences from the published figures, in their standard deviations. The "
        "figures are sampled as normal scores of their priors. The first simulations are drawn from the prior, later "
        "ones from normal distributions with the moments of a generation.\n\n"
        f"{result['simulations']} simulations ({numbers} by proposal). The {result['particles']} nearest to the data "
        "are accepted, weighted by prior over proposals: the **effective sample size is "
        f"{result['effective_sample_size']:.1f}**. Their median distance is {result['median_distance']:.1f} and the "
        f"greatest {result['epsilon']:.1f}; two replicates of the same model differ by about "
        f"{result['least_epsilon']:.1f}. {_tolerance(result)} A longer run continues the same folder.\n\n"
        "The accepted simulations are adjusted to the data by linear regression of the normal scores on the "
        f"differences, which moves a score by {result['moved']:.2f} on average. Where no accepted simulation is near "
        "the data, this extrapolates."
    )


def _tolerance(result: Mapping[str, Any]) -> str:
    """Return what the tolerance means for the posterior."""
    if result["epsilon"] <= 1.2 * result["least_epsilon"]:
        return "A smaller tolerance would only select replicates by chance."
    return (
        f"The tolerance is {result['epsilon'] / result['least_epsilon']:.1f} times that, so without the adjustment "
        "below the posterior would be wider than the exact one."
    )


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".strip().removesuffix(" 1")


def _figures(figures: Mapping[str, Any]) -> str:
    rows = []
    for name, figure in figures.items():
        prior, posterior = (
            f"{figure[key][1]:.3g} ({figure[key][0]:.3g} to {figure[key][2]:.3g})"
            for key in ("prior", "posterior")
        )
        rows.append(
            (
                f"`{name}`",
                figure["unit"],
                figure["origin"],
                figure["reason"],
                prior,
                posterior,
                f"{figure['contraction']:.2f}",
            )
        )
    return (
        "Median and 95 % interval. The contraction is 1 - var(posterior) / var(prior): 1 if the data determine a "
        "figure, 0 if they say nothing. The last figures are explanations: up to 0.5 an explanation is absent, above "
        "that its strength rises to its limit at 1.\n\n"
        + table(("figure", "unit", "origin", "reason", "prior", "posterior", "contraction"), rows)
    )


def _data(result: Mapping[str, Any]) -> str:
    rows = []
    for name, datum in result["conditioned_on"].items():
        low, middle, high = result["accepted"][name]
        rows.append(
            (
                TITLES[name],
                percentage(datum["value"]),
                percentage(datum["deviation"]),
                f"{percentage(middle)} ({percentage(low)} to {percentage(high)})",
            )
        )
    return (
        "Published, its standard deviation, and the accepted simulations. A claim without a number counts by what is "
        "missing to it, with an assumed deviation of 5 points. The accepted simulations are those before the "
        "adjustment.\n\n"
        + table(("figure at 20 N", "published", "standard deviation", "accepted: median, 95 %"), rows)
    )


def _predictions(result: Mapping[str, Any]) -> str:
    if not result["predictions"]:
        command = "python plugins/paper/benchmarks/posterior.py --out FOLDER"
        return f"Not simulated in this run: `{command}` continues with them."
    rows = []
    for name, prediction in result["predictions"].items():
        is_share = not name.startswith("fig_")

        def show(value: float | None, is_share: bool = is_share, name: str = name) -> str:
            if value is None or math.isnan(value):
                return ""
            if name == "gain":
                return f"{_points(value)} points"
            return percentage(value) if is_share else f"{value:.4g}"

        low, high = prediction["interval"]
        verdict = ""
        if prediction["published"] is not None and prediction["deviation"] is not None:
            verdict = "yes" if _met(prediction) else "no"
        rows.append(
            (
                prediction["what"],
                show(prediction["published"]),
                show(prediction["mean"]),
                f"{show(low)} to {show(high)}",
                verdict,
            )
        )
    return (
        "None of these were used for the inference. The interval is that of one replicate with the numbers of trials "
        f"of the paper, over {result['predicted_particles']} particles (effective sample size "
        f"{result['predicted_effective_sample_size']:.1f}).\n\n"
        + table(
            ("figure", "published", "predicted mean", "95 % of one replicate", "published within that"), rows
        )
    )


def _explanations(explanations: Mapping[str, Any], size: float) -> str:
    rows = [("none of them", "", "", "", "", "", _interval(explanations["none"]), "")]
    for explanation in explanations["of"].values():
        on = _particles(explanation["at_20_n"], size)
        strength = _number(explanation["full_strength"], explanation["unit"])
        rows.append(
            (
                f"{explanation['says']} (`{explanation['figure']}`, full strength {strength})",
                _factor(explanation["at_20_n"], on),
                _factor(explanation["before_adjustment"], _particles(explanation["before_adjustment"], size)),
                _factor(explanation["with_table_4"], on),
                _mean(explanation["gain_if_on"]),
                _mean(explanation["gain_if_off"]),
                _interval(explanation["alone"]),
                _interval(explanation["explains"]),
            )
        )
    together = explanations["all"]
    rows.append(
        ("all of them", "", "", "", "", "", _interval(together["alone"]), _interval(together["explains"]))
    )
    return (
        "Each explanation is on or off with equal prior probability, beside all other figures. The Bayes factor is the "
        "posterior odds that it is on: by the data at 20 N, with the adjustment and before it, and with the rates of "
        "Table IV at 17 and 23 N too, by logistic regression over the particles at the printed rates (bootstrap "
        f"interval). The intervals count the size of the sample, not the error of the adjustment.{_reach(explanations)}"
        " Points are the rate at 23 N minus that at 17 N, printed: +25.0. *If "
        "on* and *if off* are means over the particles, with the strength that the data at 20 N allow. *Alone* is at "
        "full strength with all others off, whether or not the data at 20 N allow it; *explains* is that minus the "
        f"rise with none of them, in the same {_replicates(explanations)} particles. All intervals are 95 % of the "
        "mean.\n\n"
        + table(
            (
                "explanation",
                "Bayes factor, 20 N",
                "before the adjustment",
                "Bayes factor with Table IV",
                "points if on",
                "points if off",
                "points alone",
                "explains",
            ),
            rows,
        )
    )


def _reach(explanations: Mapping[str, Any]) -> str:
    """Return how far the simulated rises reach towards the printed one."""
    if explanations["greatest_gain"] is None:
        return ""
    return (
        f" The greatest rise of a particle's replicate is {_points(explanations['greatest_gain'])} points, so this "
        "regression extrapolates to the printed ones if that is below +25.0."
    )


def _replicates(explanations: Mapping[str, Any]) -> int:
    return int(explanations["none"]["replicates"]) if explanations["none"] else 0


def _mean(summary: Mapping[str, Any] | None) -> str:
    """Return a mean over particles with the interval of the mean, if there are enough of them."""
    if summary is None:
        return "not simulated"
    if summary["effective_sample_size"] < MIN_PARTICLES:
        return f"too few particles ({summary['effective_sample_size']:.0f})"
    return _interval({**summary, "interval": summary["interval_of_mean"]})


def _particles(odds: Mapping[str, float], size: float) -> float:
    """Return the effective number of particles with the explanation, or without it, whichever are fewer."""
    return size * min(odds["probability"], 1.0 - odds["probability"])


def _factor(odds: Mapping[str, float] | None, particles: float = math.inf) -> str:
    if odds is None:
        return "not known"
    if particles < MIN_PARTICLES:
        return f"too few particles ({particles:.0f})"
    return f"{odds['bayes_factor']:.2g} ({odds['bayes_factor_low']:.2g} to {odds['bayes_factor_high']:.2g})"


def _interval(effect: Mapping[str, Any] | None) -> str:
    if effect is None:
        return "not simulated"
    low, high = effect["interval"]
    return f"{_points(effect['mean'])} ({_points(low)} to {_points(high)})"


def _uneven(p: Mapping[str, float]) -> str:
    """Return which histograms are not flat, by Bonferroni's correction for their number."""
    names = [f"`{name}`" for name, value in p.items() if value * len(p) < 0.05]
    if not names:
        return f"None of the {len(p)} histograms differs from a flat one (corrected for their number)."
    return (
        f"Not flat, corrected for their number: {', '.join(names)}; nothing should be concluded from the intervals of "
        "these."
    )


def _calibration(calibration: Mapping[str, Any]) -> str:
    rows = [
        (f"`{name}`", " ".join(map(str, counts)), f"{calibration['p'][name]:.2f}")
        for name, counts in calibration["histograms"].items()
    ]
    return (
        f"Each of {calibration['runs']} simulations that were drawn from the prior was taken as the data in turn. Its "
        f"posterior are the {percentage(calibration['accepted'])} of the others that are nearest to it, weighted and "
        "adjusted to it in the same way. A rank histogram counts where the true figure lies within this posterior; it "
        "should be flat. High counts in the middle mean posteriors that are too wide, as a large tolerance makes them; "
        "at the ends, too narrow. A test compares a whole inference of twenty figures with a posterior that is known "
        f"exactly. Of all true figures, {percentage(calibration['coverage_90'])} lie within the 90 % interval. All "
        f"together: {' '.join(map(str, calibration['all']))}. {_uneven(calibration['p'])}\n\n"
        + table(("figure", f"ranks in {calibration['bins']} equal parts", "p that it is flat"), rows)
    )
