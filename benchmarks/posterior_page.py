"""The page of a posterior, in Markdown, from the result of `benchmarks/posterior.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from graspsense.evaluation.intervals import percentage

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
PINNED: Final = 0.5
"""Contraction from which on a figure counts as determined by the data."""
LEAST_SAMPLE: Final = 30.0
"""Effective sample size below which nothing is said of single figures and explanations."""
LEFT_OUT: Final = (
    "The nonlinearity of a cell (counts against force): nothing of it was simulated. It is monotone, so a tree with "
    "thresholds hardly notices it.",
    "The nonlinearity of the pads as an explanation. The simulated pads were linear when this was run.",
    "Wear between the squeezes of one placement. The explanation by the order of squeezes has only the centring of "
    "the container by the fingers.",
    "A pressure that is computed from the gas. The explanation by pressure changes the share on the cells in closed "
    "containers in proportion to the probing force.",
    "What people felt (Table VI), and Fig. 4 as a curve, which is printed without numbers.",
)


def page(result: Mapping[str, Any]) -> str:
    """Return the page."""
    parts = [
        "# A posterior of the simulator's uncertain figures",
        "All grasps are simulated, with models of the gripper and of the objects.\n"
        "Made by `python benchmarks/posterior.py --out FOLDER` and `--markdown docs/posterior.md`, "
        f"{result['date']}, on {result['machine']}, pyABC {result['pyabc']}. `docs/posterior.json` has the result.",
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
        _explanations(result["explanations"]),
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
    predicted, of = result["predictions"], result["explanations"]["of"]
    tested = [
        one for one in predicted.values() if one["published"] is not None and one["deviation"] is not None
    ]
    met = [one for one in tested if _met(one)]
    rise = predicted["gain"]
    return (
        f"With the figures that the results at 20 N allow, {len(met)} of {len(tested)} published figures that were "
        "not used and have a standard deviation lie within the 95 % interval of one predicted replicate. The paper's "
        f"rate rises by 25.0 points from 17 to 23 N; predicted are {_points(rise['mean'])} points "
        f"({_points(rise['interval'][0])} to {_points(rise['interval'][1])}). {_strongest(of)}"
        f"{_determined(result)}"
    )


def _strongest(of: Mapping[str, Any]) -> str:
    """Return which explanation alone gives most; nothing if this was not simulated."""
    alone = {name: one["alone"]["mean"] for name, one in of.items() if name != "none" and one["alone"]}
    if not alone:
        return ""
    best = max(alone, key=lambda name: alone[name])
    return (
        f"The strongest explanation alone, {of[best]['says']}, gives {_points(alone[best])} points on average at its "
        "full strength. "
    )


def _determined(result: Mapping[str, Any]) -> str:
    """Return which figures the data determine, if the sample is large enough to say so."""
    size, figures = result["effective_sample_size"], result["figures"]
    if size < LEAST_SAMPLE:
        return (
            f"**This run is small: its effective sample size is {size:.1f}. It shows that the method works from end to "
            "end; contractions and Bayes factors of this size arise by chance, and nothing follows from them.**"
        )
    names = [name for name, one in figures.items() if one["contraction"] >= PINNED]
    if not names:
        return f"None of the {len(figures)} figures is determined by these data (contraction of {PINNED:g} or more)."
    return f"The data determine {len(names)} of the {len(figures)} figures ({', '.join(names)})."


def _met(one: Mapping[str, Any]) -> bool:
    low, high = one["interval"]
    return bool(low <= one["published"] <= high)


def _points(share: float) -> str:
    return f"{100 * share:+.1f}"


def _method(result: Mapping[str, Any]) -> str:
    epsilons = ", ".join(f"{one:.1f}" for one in result["epsilon"])
    numbers = ", ".join(map(str, result["simulations_by_generation"]))
    return (
        "Approximate Bayesian computation with sequential Monte Carlo. Every simulation is one replicate of section "
        "III.E at 20 N (66, 41, 42 and 80 grasps of 12, 10, 12 and 16 containers) with C4.5 in ten folds. Its distance "
        "is the root of the sum of squared differences from the published figures, in their standard deviations. "
        f"{result['particles']} particles, {result['generations']} generations, {result['simulations']} simulations "
        f"({numbers} by generation); tolerances {epsilons}. The median distance at the end is "
        f"{result['median_distance']:.1f}; {result['least_epsilon']:.1f} is about what the scatter of the published "
        f"figures alone gives. {_tolerance(result)} The **effective sample size is "
        f"{result['effective_sample_size']:.1f}**, so that intervals are coarse. A run with more particles or "
        "generations continues the same folder."
    )


def _tolerance(result: Mapping[str, Any]) -> str:
    """Return what the tolerance means for the posterior."""
    if result["epsilon"][-1] <= 1.2 * result["least_epsilon"]:
        return "A smaller tolerance would only select replicates by chance."
    return (
        f"The last tolerance is {result['epsilon'][-1] / result['least_epsilon']:.1f} times that, so the posterior is "
        "wider than the exact one."
    )


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".strip().removesuffix(" 1")


def _figures(figures: Mapping[str, Any]) -> str:
    rows = []
    for name, one in figures.items():
        prior, posterior = (
            f"{one[key][1]:.3g} ({one[key][0]:.3g} to {one[key][2]:.3g})" for key in ("prior", "posterior")
        )
        rows.append(
            (
                f"`{name}`",
                one["unit"],
                one["origin"],
                one["reason"],
                prior,
                posterior,
                f"{one['contraction']:.2f}",
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
    for name, one in result["conditioned_on"].items():
        low, middle, high = result["fitted"][name]
        rows.append(
            (
                TITLES[name],
                percentage(one["value"]),
                percentage(one["deviation"]),
                f"{percentage(middle)} ({percentage(low)} to {percentage(high)})",
            )
        )
    return (
        "Published, its standard deviation, and the accepted simulations. A claim without a number counts by what is "
        "missing to it, with an assumed deviation of 5 points.\n\n"
        + table(("figure at 20 N", "published", "standard deviation", "accepted: median, 95 %"), rows)
    )


def _predictions(result: Mapping[str, Any]) -> str:
    rows = []
    for name, one in result["predictions"].items():
        is_share = not name.startswith("fig_")

        def show(value: float | None, is_share: bool = is_share, name: str = name) -> str:
            if value is None or math.isnan(value):
                return ""
            if name == "gain":
                return f"{_points(value)} points"
            return percentage(value) if is_share else f"{value:.4g}"

        low, high = one["interval"]
        verdict = ""
        if one["published"] is not None and one["deviation"] is not None:
            verdict = "yes" if _met(one) else "no"
        rows.append(
            (one["what"], show(one["published"]), show(one["mean"]), f"{show(low)} to {show(high)}", verdict)
        )
    return (
        "None of these were used for the inference. The interval is that of one replicate with the numbers of trials "
        f"of the paper, over {result['predicted_particles']} particles (effective sample size "
        f"{result['predicted_effective_sample_size']:.1f}).\n\n"
        + table(
            ("figure", "published", "predicted mean", "95 % of one replicate", "published within that"), rows
        )
    )


def _explanations(explanations: Mapping[str, Any]) -> str:
    rows = []
    for name, one in explanations["of"].items():
        if name == "none":
            rows.append((one["says"], "", "", "", "", _interval(one["alone"])))
            continue
        rows.append(
            (
                f"{one['says']} (`{one['figure']}`, full strength {_number(one['full_strength'], one['unit'])})",
                _factor(one["at_20_n"]),
                _factor(one["with_table_4"]),
                _interval(one["gain_if_on"]),
                _interval(one["gain_if_off"]),
                _interval(one["alone"]),
            )
        )
    return (
        "Each explanation is on or off with equal prior probability, beside all other figures. The Bayes factor is the "
        "posterior odds that it is on: by the data at 20 N, and with the rates of Table IV at 17 and 23 N added by "
        f"weights (effective sample size then {explanations['effective_sample_size_with_table_4']:.1f}; its interval "
        "is only that of so small a sample). Points are the rate at 23 N minus that at 17 N, printed: +25.0. *Alone* "
        "is at full strength with all others off, whether or not the data at 20 N allow it: the mean of "
        f"{_replicates(explanations)} replicates with its 95 % interval; the other columns have the interval of one "
        "replicate.\n\n"
        + table(
            (
                "explanation",
                "Bayes factor, 20 N (95 %)",
                "Bayes factor with Table IV (95 %)",
                "points if on",
                "points if off",
                "points alone at full strength",
            ),
            rows,
        )
        + "\n\nWith Table IV as data too, the weighted particles rise by "
        + f"{_interval(explanations['gain_with_table_4'])} points. Within this sample, the rest of +25.0 stays "
        + "unexplained."
    )


def _replicates(explanations: Mapping[str, Any]) -> int:
    alone = explanations["of"]["none"]["alone"]
    return int(alone["replicates"]) if alone else 0


def _factor(one: Mapping[str, float]) -> str:
    return f"{one['bayes_factor']:.2g} ({one['bayes_factor_low']:.2g} to {one['bayes_factor_high']:.2g})"


def _interval(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "none simulated"
    low, high = one["interval"]
    return f"{_points(one['mean'])} ({_points(low)} to {_points(high)})"


def _calibration(calibration: Mapping[str, Any]) -> str:
    rows = [
        (f"`{name}`", " ".join(map(str, counts)), f"{calibration['p'][name]:.2f}")
        for name, counts in calibration["histograms"].items()
    ]
    return (
        f"Each of {calibration['runs']} simulations that were drawn from the prior was taken as the data in turn. Its "
        f"posterior are the {percentage(calibration['accepted'])} of the others that are nearest to it. A rank "
        "histogram counts where the true figure lies within this posterior; it should be flat. High counts in the "
        "middle mean posteriors that are too wide, as a large tolerance makes them; at the ends, too narrow. This "
        "checks the statistics, the distance and the acceptance with the real simulator; the weights of later "
        f"generations are not in it. Of all true figures, {percentage(calibration['coverage_90'])} lie within the 90 % "
        f"interval. All together: {' '.join(map(str, calibration['all']))}.\n\n"
        + table(("figure", f"ranks in {calibration['bins']} equal parts", "p that it is flat"), rows)
    )
