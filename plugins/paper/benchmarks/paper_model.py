"""The trials of Chitta, Piccoli and Sturm (2010) as a function of the uncertain figures of the simulator.

`PRIORS` has the figures with their prior distributions, `EXPLANATIONS` those of the effects that may explain why the
rate rises with the force. `rates_at_20_n` simulates what a posterior is conditioned on, `predictions` what it predicts.
Both draw one replicate with the numbers of trials of the paper, so that their scatter is that of the paper's figures.
`plugins/paper/benchmarks/posterior.py` uses this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve
from fit import (
    FOLDS,
    SPLITS,
    SPREAD,
    TRIALS,
    Observed,
    Squeeze,
    as_toml,
    by_the_splits,
    rate,
    rates_of_tables,
    squeeze_of,
)
from sklearn.model_selection import PredefinedSplit, cross_val_predict

from graspsense.core.values.trace import Trace
from graspsense.evaluation.folds import stratified
from graspsense.plugin_api import Features, create
from graspsense.sources.simulated import OBJECTS_PER_SEED, TRIALS_PER_SEED, Group, PlannedTrial
from graspsense_c45 import C45Classifier
from graspsense_paper.claims import split_by
from graspsense_paper.grasping import measures
from graspsense_paper.inference import Prior
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.batch import run_many
from graspsense_sim_gripper.scene.library import catalogue, object_kinds

Values = Mapping[str, float]
"""Name of a figure to its value."""

PRIORS: Final = (
    Prior(
        name="coulomb_n",
        unit="N",
        law="truncnorm",
        args=(-2.0, 2.0, 7.0, 0.7),
        origin="published elsewhere",
        reason="pr2_gripper_sensor feeds forward 7 N; a tenth either way between grippers is assumed",
    ),
    Prior(
        name="load_friction_coefficient",
        unit="1",
        law="uniform",
        args=(0.3, 0.4),
        origin="published elsewhere",
        reason="the qualification script of the robot: about 20 N on a flat surface at 23 N; its width is assumed",
    ),
    Prior(
        name="share",
        unit="1",
        law="uniform",
        args=(0.25, 0.4),
        origin="assumed",
        reason="share of the force on the cells: a line across the pad loads less of it than the block's face, 0.85",
    ),
    Prior(
        name="share_naked",
        unit="1",
        law="uniform",
        args=(0.7, 0.5),
        origin="assumed",
        reason="Naked over Odwalla: a rounder wall may touch fewer cells, shoulders more",
    ),
    Prior(
        name="share_spread",
        unit="1",
        law="loguniform",
        args=(0.005, 0.06),
        origin="assumed",
        reason="between placements: the patch moves over the edge of the pad",
    ),
    Prior(
        name="k1_n_m",
        unit="N/m",
        law="loguniform",
        args=(1200.0, 4000.0),
        origin="assumed",
        reason="a 0.4 mm PET wall under the pad, Odwalla; the other containers keep their ratio to it",
    ),
    Prior(
        name="stiffness_scale",
        unit="1",
        law="uniform",
        args=(0.5, 3.5),
        origin="assumed",
        reason="factor on the spreads of stiffness between containers that the catalogue gives reasons for",
    ),
    Prior(
        name="placement_spread",
        unit="1",
        law="uniform",
        args=(0.0, 0.3),
        origin="assumed",
        reason="spread of stiffness between placements of one container: where on the wall the pads land",
    ),
    Prior(
        name="wall_yield",
        unit="1",
        law="loguniform",
        args=(0.25, 4.0),
        origin="assumed",
        reason="factor on how far the wall of a closed container bulges, which is known to a factor of four",
    ),
    Prior(
        name="damping_n_s_m",
        unit="N s/m",
        law="loguniform",
        args=(30.0, 1500.0),
        origin="assumed",
        reason="loss in the open, full Odwalla bottle: no measurement, so the order of magnitude is free",
    ),
    Prior(
        name="damping_others",
        unit="1",
        law="loguniform",
        args=(0.05, 1.0),
        origin="assumed",
        reason="loss of the other containers over that of Odwalla",
    ),
    Prior(
        name="naked_wider_m",
        unit="m",
        law="uniform",
        args=(-0.002, 0.004),
        origin="assumed",
        reason="Naked minus Odwalla: bottles of the same volume",
    ),
    Prior(
        name="offset_spread_m",
        unit="m",
        law="uniform",
        args=(0.0, 0.0045),
        origin="assumed",
        reason="how well a person centres a container; with more, some would not fit between the open fingers",
    ),
    Prior(
        name="pad_stiffness_n_m",
        unit="N/m",
        law="loguniform",
        args=(1e4, 1e5),
        origin="assumed",
        reason="the cover of a fingertip at small forces: no measurement, so a factor of ten is free",
    ),
    Prior(
        name="cell_curvature",
        unit="1",
        law="uniform",
        args=(-0.15, 0.3),
        origin="assumed",
        reason="relative error of a pad's force at 10 N, in proportion to the force: cells are nonlinear either way",
    ),
    Prior(
        name="one_state",
        unit="1",
        law="uniform",
        args=(0.0, 1.0),
        origin="assumed",
        reason="above 0.5: each container is used in one state only. Section III.E does not tell",
    ),
)
"""The uncertain figures. The ranges come from the text of the reason, not from the results of the paper."""

OFF_BELOW: Final = 0.5
"""An explanation with a value below this is absent, which has the prior probability 0.5; above, its strength rises
linearly from its absence to its limit."""


class Explanation(NamedTuple):
    """An effect that may raise the rate with the force: its figure if absent, and at full strength."""

    figure: str
    unit: str
    absent: float
    limit: float
    says: str
    reason: str


EXPLANATIONS: Final = {
    "friction": Explanation(
        "coulomb_spread_n",
        "N",
        0.4,
        4.0,
        "the friction of the drive varies more between trials",
        "its effect on the features does not grow with the force; absent, it is that of the default gripper",
    ),
    "pressure": Explanation(
        "share_pressure",
        "1",
        0.0,
        0.6,
        "the share of the force on the cells depends on the pressure in a closed container",
        "relative change of the share at 20 N in closed containers, in proportion to the probing force",
    ),
    "order": Explanation(
        "offset_kept",
        "1",
        1.0,
        0.0,
        "17, 20 and 23 N were the first, second and third squeeze of one placement",
        "share of the offset that a squeeze leaves: the fingers centre the container",
    ),
    "hardening": Explanation(
        "1 / pad_hardening_m",
        "1/m",
        0.0,
        5000.0,
        "the pads stiffen with the force",
        "at full strength a pad has twice the force of a linear spring at 0.2 mm: thin rubber on metal",
    ),
}
"""Explanations by name. Each is one figure of the posterior, whose prior is uniform from 0 to 1."""

NAMES: Final = (*(prior.name for prior in PRIORS), *EXPLANATIONS)
TABLE_IV: Final = (96, 12)
FORCES_N: Final = (17.0, 20.0, 23.0)
PLACEMENT_NODES: Final = ((-(3.0**0.5), 1 / 6), (0.0, 2 / 3), (3.0**0.5, 1 / 6))
"""Three values with probabilities that have the first five moments of a standard normal number: stiffness differs
between placements by these, so that a container needs three scenes."""
REFERENCE_N: Final = 10.0
"""Force on a pad for which `cell_curvature` is the relative error."""
SPLIT: Final = 0.9
"""A claim that a feature separates two groups is met from this share on, as in the claims of the paper."""
CONTAINERS: Final = tuple(TRIALS)


def strength(name: str, values: Values) -> float:
    """Return the figure of an explanation, in its unit."""
    explanation = EXPLANATIONS[name]
    share = max(values[name] - OFF_BELOW, 0.0) / (1.0 - OFF_BELOW)
    return explanation.absent + share * (explanation.limit - explanation.absent)


def is_on(name: str, values: Values) -> bool:
    """Return whether an explanation is present."""
    return values[name] > OFF_BELOW


class Trials(NamedTuple):
    """Grasps: their labels, and what was extracted from each."""

    labels: list[str]
    extracted: list[Any]

    def of_containers(self, *kinds: str) -> Trials:
        """Return the trials of these containers."""
        kept = [i for i, label in enumerate(self.labels) if label.partition(":")[0] in kinds]
        return Trials([self.labels[i] for i in kept], [self.extracted[i] for i in kept])


def config_of(values: Values) -> SimConfig:
    """Return the settings of the gripper with these figures."""
    hardening = strength("hardening", values)
    return SimConfig(
        fidelity="fixed",
        coulomb_n=values["coulomb_n"],
        breakaway_n=values["coulomb_n"] + 1.0,
        load_friction_coefficient=values["load_friction_coefficient"],
        coulomb_spread_n=strength("friction", values),
        pad_stiffness_n_m=values["pad_stiffness_n_m"],
        pad_hardening_m=1.0 / hardening if hardening > 0.0 else None,
    )


def with_nonlinear_cells(extract: Callable[[Trace], Any], curvature: float) -> Callable[[Trace], Any]:
    """Return an extraction that sees the forces as cells with this nonlinearity show them."""

    def shown(force_n: Any) -> Any:
        return force_n * (1.0 + curvature / REFERENCE_N * force_n)

    def extracted(trace: Trace) -> Any:
        return extract(
            evolve(trace, force_left_n=shown(trace.force_left_n), force_right_n=shown(trace.force_right_n))
        )

    return extracted


def scene_of(name: str, values: Values, force_n: float, node: float) -> str:
    """Return the scene of an object of the catalogue with these figures, under this force and at one placement."""
    spec, (kind, _, state) = catalogue()[name], name.partition(":")
    kind = kind.removesuffix("_worn")
    scale = values["k1_n_m"] / 2200.0 * float(np.exp(values["placement_spread"] * node))
    loss = values["damping_n_s_m"] * (1.0 if kind == "odwalla" else values["damping_others"])
    changes: dict[str, Callable[[float], float]] = {
        "k1_n_m": lambda old: old * scale,
        "k_n_m": lambda old: old * scale,
        "bulge_m3_pa": lambda old: old * values["wall_yield"],
        "damping_n_s_m": lambda _: loss,
    }
    share = values["share"] * (values["share_naked"] if kind == "naked" else 1.0)
    if state.endswith("closed"):
        share *= 1.0 + strength("pressure", values) * force_n / 20.0
    squeezes_before = FORCES_N.index(force_n)
    reason = next(text for where, text in spec.reasons.items() if where.endswith("stiffness_spread"))
    reasoned = SPREAD.search(reason)
    assert reasoned is not None, f"{name}: the reason of its stiffness_spread names no scale"
    return as_toml(
        evolve(
            spec,
            width_m=spec.width_m if kind != "naked" else 0.0584 + values["naked_wider_m"],
            share=min(share, 1.0),
            share_spread=values["share_spread"],
            stiffness_spread=float(reasoned[1]) * values["stiffness_scale"],
            offset_spread_m=values["offset_spread_m"] * strength("order", values) ** squeezes_before,
            terms=tuple(
                (term, {key: changes.get(key, float)(old) for key, old in params.items()})
                for term, params in spec.terms
            ),
        )
    )


def squeeze(
    groups: Mapping[str, tuple[int, int]],
    values: Values,
    seed: int,
    force_n: float,
    extract: Callable[[Trace], Any],
    first_instance: int = 0,
) -> Trials:
    """Grasp containers of these kinds, each with a number of trials and of instances, at one force."""
    one_state = values["one_state"] > 0.5
    states = {kind.name: [f"{kind.name}:{state}" for state in kind.states] for kind in object_kinds()}
    planned: list[tuple[int, PlannedTrial]] = []
    for k, (kind, (total, instances)) in enumerate(groups.items()):
        group = Group(
            named={name: name for name in states[kind]},
            total=total,
            instances=instances,
            states_per_instance="one" if one_state else "all",
        )
        # Instances of different kinds have different numbers, because all scenes have the same name.
        planned += [(first_instance + 50 * k + trial.instance, trial) for trial in group.planned(())]
    rng = np.random.default_rng([seed, int(force_n), first_instance])
    nodes = rng.choice(len(PLACEMENT_NODES), len(planned), p=[share for _, share in PLACEMENT_NODES])
    texts = {
        (name, k): scene_of(name, values, force_n, PLACEMENT_NODES[k][0])
        for name, k in {(trial.object_name, int(k)) for (_, trial), k in zip(planned, nodes, strict=True)}
    }
    scenes = [
        f"{texts[trial.object_name, int(k)]}\n#{OBJECTS_PER_SEED * seed + number}"
        for (number, trial), k in zip(planned, nodes, strict=True)
    ]
    offset = TRIALS_PER_SEED * seed + 1000 * int(force_n) + first_instance
    done = run_many(
        config_of(values),
        create("controller", "hybrid", probing_force_n=force_n),
        scenes,
        [offset + k for k in range(len(planned))],
        extract=with_nonlinear_cells(extract, values["cell_curvature"]),
        traces=False,
        compiled=True,
        workers=1,
    )
    return Trials([trial.label for _, trial in planned], [trial.extracted for trial in done])


def matrix_of(features: Sequence[Features]) -> Any:
    """Return the features as an array, shape (trials, features)."""
    return np.array([feature.values for feature in features])


def answers(features: Sequence[Features], labels: Sequence[str], seed: int) -> list[str]:
    """Return what a C4.5 tree with J48's defaults answers for each trial, in ten stratified folds."""
    folds = PredefinedSplit(stratified(labels, FOLDS, seed))
    predicted = cross_val_predict(C45Classifier(), matrix_of(features), list(labels), cv=folds)
    return [str(label) for label in predicted]


def rate_of(features: Sequence[Features], labels: Sequence[str], seed: int) -> float:
    """Return how often a label is told, in ten stratified folds."""
    return rate(answers(features, labels, seed), labels)


def split(
    trials: Trials, feature: str, is_low: Callable[[str], bool], is_high: Callable[[str], bool]
) -> float:
    """Return the largest share that one threshold assigns correctly; 0.5 if one group never has the feature."""
    sides: list[list[float]] = [[], []]
    for label, features in zip(trials.labels, trials.extracted, strict=True):
        value = features.as_dict()[feature]
        for k, belongs in enumerate((is_low, is_high)):
            if belongs(label) and value is not None:
                sides[k].append(value)
    return split_by(*sides) if all(sides) else 0.5


def of_kind(kind: str) -> Callable[[str], bool]:
    """Return whether a label is of this container."""
    return lambda label: label.startswith(f"{kind}:")


def rates_at_20_n(values: Values, seed: int) -> dict[str, float]:
    """Return the figures of Tables II and III and the facts at 20 N, of one replicate: what is conditioned on."""
    trials = squeeze(TRIALS, values, seed, 20.0, create("feature-set", "chitta").extract)
    classes = [label.partition(":")[0] for label in trials.labels]
    predicted = answers(trials.extracted, classes, seed)
    pairs = [(a, b) for a, b in zip(predicted, classes, strict=True) if a != b]
    alike = sum({a, b} == {"odwalla", "naked"} for a, b in pairs)
    statistics = {"table_2": rate(predicted, classes), "confused": alike / len(pairs) if pairs else 0.0}
    for kind in CONTAINERS:
        own = trials.of_containers(kind)
        statistics[f"table_3_{kind}"] = rate_of(own.extracted, own.labels, seed)
    lowest, bottles = 1.0, 0.0
    for i, a in enumerate(CONTAINERS):
        for b in CONTAINERS[i + 1 :]:
            share = split(trials, "p_first", of_kind(a), of_kind(b))
            if {a, b} == {"odwalla", "naked"}:
                bottles = share
            else:
                lowest = min(lowest, share)
    f_steady = split(trials, "f_steady", of_kind("odwalla"), of_kind("naked"))
    # Claims without a number: what is missing to them.
    statistics["p_first_separates"] = max(SPLIT - lowest, 0.0)
    statistics["p_first_does_not_separate"] = max(bottles - SPLIT, 0.0)
    statistics["f_steady_separates"] = max(SPLIT - f_steady, 0.0)
    return statistics


def observed() -> dict[str, Observed]:
    """Return the published figures that a posterior is conditioned on."""
    figures = rates_of_tables()
    figures["confused"] = Observed(9 / 14, (9 / 14 * 5 / 14 / 14) ** 0.5)
    for name in ("p_first_separates", "p_first_does_not_separate", "f_steady_separates"):
        figures[name] = Observed(0.0, 0.05)
    return figures


def gain(values: Values, seed: int) -> float:
    """Return the rate of Table IV at 23 N minus that at 17 N, of one replicate."""
    extract = create("feature-set", "chitta").extract
    rates = []
    for force_n in (FORCES_N[0], FORCES_N[-1]):
        trials = squeeze({"odwalla": TABLE_IV}, values, seed, force_n, extract)
        rates.append(rate_of(trials.extracted, trials.labels, seed))
    return rates[1] - rates[0]


def predictions(values: Values, seed: int) -> dict[str, float]:
    """Return one replicate of the predictions: Tables IV and V, section III.F, Fig. 6, the tree's splits."""
    feature_set = create("feature-set", "chitta")

    def extract(trace: Trace) -> tuple[Features, Squeeze]:
        return feature_set.extract(trace), squeeze_of(trace)

    figures: dict[str, float] = {}
    for force_n in FORCES_N:
        grasps = squeeze({"odwalla": TABLE_IV}, values, seed, force_n, extract)
        trials = Trials(grasps.labels, [features for features, _ in grasps.extracted])
        figures[f"table_4_{force_n:g}"] = rate_of(trials.extracted, trials.labels, seed)
    figures["gain"] = figures["table_4_23"] - figures["table_4_17"]
    # The trials at 23 N, the last ones.
    squeezes = [squeezed for _, squeezed in grasps.extracted]
    figures |= _squeezes(trials, squeezes)
    without_water = {kind: TRIALS[kind] for kind in CONTAINERS if kind != "water"}
    eleven = squeeze(without_water, values, seed, 20.0, feature_set.extract)
    figures["eleven_classes"] = rate_of(eleven.extracted, eleven.labels, seed)
    states = [state_of(label) for label in trials.labels]
    tree = C45Classifier().fit(matrix_of(trials.extracted), states)
    worn = {"odwalla_worn": TABLE_IV}
    tested = squeeze(worn, values, seed, 23.0, feature_set.extract, first_instance=500)
    told = tree.predict(matrix_of(tested.extracted)).tolist()
    figures["worn_bottles"] = rate(told, [state_of(label) for label in tested.labels])
    return {**figures, **_fig_6(values, seed)}


def state_of(label: str) -> str:
    """Return the state in a label."""
    return label.partition(":")[2]


def _squeezes(trials: Trials, squeezes: Sequence[Squeeze]) -> dict[str, float]:
    """Return what section III.F says of squeezes at 23 N, and how the authors' tree sorts them."""
    states = [state_of(label) for label in trials.labels]
    splits = by_the_splits(states, squeezes)
    figures = {name: splits[name] for name in (*SPLITS, "tree")}
    for feature, state, others in (
        ("f_steady", "empty_open", ("empty_closed",)),
        ("p_steady", "full_closed", ("full_open", "empty_closed", "empty_open")),
    ):
        figures[f"{feature}_splits"] = split(
            trials,
            feature,
            lambda label, state=state: state_of(label) == state,  # type: ignore[misc]
            lambda label, others=others: state_of(label) in others,  # type: ignore[misc]
        )
    times = {
        state: np.nanmedian([s.delta_t_s for s, own in zip(squeezes, states, strict=True) if own == state])
        for state in set(states)
    }
    figures["full_open_longest"] = float(max(times, key=lambda state: times[state]) == "full_open")
    return figures


def _fig_6(values: Values, seed: int) -> dict[str, float]:
    """Return what Fig. 6 shows: a wooden block under hybrid control."""
    feature_set = create("feature-set", "chitta")

    def extract(trace: Trace) -> tuple[dict[str, float], Features]:
        return measures(trace), feature_set.extract(trace)

    (done,) = run_many(
        evolve(config_of(values), fidelity="scene"),
        create("controller", "hybrid", probing_force_n=23.0),
        ["block"],
        [TRIALS_PER_SEED * seed + 900],
        extract=extract,
        traces=False,
        compiled=True,
        workers=1,
    )
    measured, features = done.extracted
    return {
        "fig_6_peak_n": measured.get("measured_peak_force_n", float("nan")),
        "fig_6_rest_s": features.as_dict()["delta_t"] or float("nan"),
    }
