"""The posterior of the simulator's uncertain figures: the model of the paper's trials, and the published page."""

import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy
from attrs import NOTHING, fields
from cases import every_case

from graspsense.core.values.trace import Trace
from graspsense.evaluation.intervals import percent

pytest.importorskip("graspsense_sim_gripper", reason="the paper is done again in simulation")
pytest.importorskip("graspsense_c45", reason="the paper's classifier")

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benchmarks"))
import paper_model  # noqa: E402


@cache
def medians():
    """Return the median of every prior, which needs scipy.stats, with explanations that are absent."""
    priors = {prior.name: float(prior.distribution().median()) for prior in paper_model.PRIORS}
    return {**priors, **dict.fromkeys(paper_model.EXPLANATIONS, 0.2)}


def trace_of_forces(forces_n):
    n = len(forces_n)
    columns = {field.name: np.zeros(n) for field in fields(Trace) if field.default is NOTHING}
    return Trace(**{**columns, "force_left_n": np.array(forces_n)})


def scene(name, force_n=20.0, node=0.0, **values):
    return tomllib.loads(paper_model.scene_of(name, {**medians(), **values}, force_n, node))


def test_the_page_has_every_figure_of_the_model_and_of_the_data():
    page = (ROOT / "benchmarks" / "results" / "posterior.md").read_text(encoding="utf-8")
    assert all(page.count(f"| `{name}` |") == 2 for name in paper_model.NAMES)
    for figure in paper_model.observed().values():
        assert f"| {percent(figure.value)} | {percent(figure.deviation)} |" in page


@pytest.mark.slow
def test_no_bayes_factor_is_given_where_too_few_particles_have_an_explanation_or_lack_it():
    pytest.importorskip("pyabc")
    posterior = pytest.importorskip("posterior")
    w = np.full(100, 0.01)
    assert posterior.factor(np.arange(100) < 1, w) == "too few particles (1)"
    assert posterior.factor(np.arange(100) < 98, w) == "too few particles (2)"
    assert posterior.factor(np.arange(100) < 75, w).startswith("3 (")


@every_case("name", paper_model.EXPLANATIONS)
def test_an_explanation_below_the_middle_is_absent_and_at_one_has_its_full_strength(name):
    explanation = paper_model.EXPLANATIONS[name]
    assert paper_model.strength(name, {name: 0.49}) == explanation.absent
    assert paper_model.strength(name, {name: 1.0}) == pytest.approx(explanation.limit)


def test_pressure_changes_the_share_in_closed_containers_with_the_force():
    off, weak, strong = (
        scene("odwalla:full_closed", force_n, pressure=on)["share"]
        for force_n, on in ((23.0, 0.0), (17.0, 1.0), (23.0, 1.0))
    )
    assert off < weak < strong
    assert scene("odwalla:full_open", 23.0, pressure=1.0)["share"] == off


def test_later_squeezes_of_a_placement_are_better_centred():
    at_17_n, at_20_n, at_23_n = (
        scene("can:full_open", force_n, order=0.75) for force_n in paper_model.FORCES_N
    )
    assert at_20_n["offset_spread_m"] == pytest.approx(at_17_n["offset_spread_m"] / 2)
    assert at_23_n["offset_spread_m"] == pytest.approx(at_17_n["offset_spread_m"] / 4)
    assert scene("can:full_open", 23.0)["offset_spread_m"] == medians()["offset_spread_m"]


def test_placements_differ_in_stiffness_as_their_spread_says():
    spread = sum(share * node**2 for node, share in paper_model.PLACEMENT_NODES)
    assert spread == pytest.approx(1.0)
    soft, stiff = (scene("odwalla:empty_open", node=node, placement_spread=0.1) for node in (0.0, 1.0))
    assert stiff["terms"][0]["k1_n_m"] / soft["terms"][0]["k1_n_m"] == pytest.approx(1.10517, abs=1e-4)


def test_pads_stiffen_only_where_that_explanation_is_present():
    assert paper_model.config_of({**medians(), "hardening": 0.4}).pad_hardening_m is None
    assert paper_model.config_of({**medians(), "hardening": 1.0}).pad_hardening_m == pytest.approx(0.0002)


def test_nonlinear_cells_show_other_forces_in_proportion_to_the_force():
    trace = trace_of_forces([0.0, 10.0, 20.0])
    shown = paper_model.with_nonlinear_cells(lambda shown_trace: shown_trace.force_left_n.tolist(), 0.1)(
        trace
    )
    assert shown == pytest.approx([0.0, 11.0, 24.0])


@pytest.mark.slow
def test_the_adjustment_moves_scores_along_their_slope_on_the_data():
    normal_scores = pytest.importorskip("normal_scores", reason="needs pyabc")
    rng = np.random.default_rng(0)
    distances = rng.normal(1.0, 1.0, (400, 2))
    scores = np.column_stack([2.0 * distances[:, 0], rng.normal(size=400)])
    adjusted = normal_scores.adjusted(scores, distances, np.ones(400))
    assert adjusted[:, 0] == pytest.approx(0.0, abs=0.05)
    assert adjusted[:, 1].std() == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_the_density_of_a_proposal_is_that_of_its_samples():
    normal_scores = pytest.importorskip("normal_scores", reason="needs pyabc")
    import pandas as pd

    rng = np.random.default_rng(1)
    np.random.seed(1)  # noqa: NPY002 (pyABC draws from it)
    transition = normal_scores.NormalScores()
    transition.fit(pd.DataFrame(rng.normal(1.0, 0.3, (100, 2)), columns=["a", "b"]), np.full(100, 0.01))
    drawn = pd.DataFrame([dict(transition.rvs_single()) for _ in range(2000)])
    # Weighted by prior over proposal, the proposals are a sample of the prior.
    w = scipy.stats.norm.pdf(drawn["a"]) * scipy.stats.norm.pdf(drawn["b"]) / transition.pdf(drawn)
    assert np.average(drawn["a"], weights=w) == pytest.approx(0.0, abs=0.2)
    assert np.average(drawn["a"] ** 2, weights=w) == pytest.approx(1.0, abs=0.3)
    assert transition.pdf(drawn.iloc[0]) == pytest.approx(transition.pdf(drawn)[0])


@pytest.mark.long
def test_an_inference_of_twenty_figures_finds_a_posterior_that_is_known(tmp_path):
    """Normal figures with linear data and normal errors: mean and standard deviation are known exactly."""
    pytest.importorskip("pyabc")
    posterior = pytest.importorskip("posterior")
    rng = np.random.default_rng(3)
    np.random.seed(3)  # noqa: NPY002 (pyABC draws from it)
    names = [f"x{k}" for k in range(20)]
    wanted = {"a": (1.5, 0.5), "b": (-1.0, 0.5), "c": (2.0, 1.0)}
    wanted = {name: paper_model.Observed(*figure) for name, figure in wanted.items()}
    depends = np.zeros((3, 20))
    depends[0, 0] = depends[1, 1] = depends[2, 0] = depends[2, 3] = 1.0
    depends[1, 2] = 0.5
    errors = np.array([figure.deviation for figure in wanted.values()])

    def simulate(scores):
        seen = depends @ [scores[name] for name in names] + errors * rng.normal(size=3)
        return dict(zip(wanted, seen, strict=True))

    done = []

    def recorded(scores):
        seen = simulate(scores)
        done.append({"t": int(abc.history.max_t) + 1, "scores": dict(scores), "statistics": seen})
        return seen

    abc = posterior.abc_of(recorded, names, wanted, 100)
    abc.new(f"sqlite:///{tmp_path / 'abc.db'}", {name: figure.value for name, figure in wanted.items()})
    history = abc.run(minimum_epsilon=1.5, max_nr_populations=4)
    sample = posterior.nearest(done, history, names, wanted, 200)
    scores, w = sample.scores, sample.weights / sample.weights.sum()
    precision = np.eye(20) + depends.T @ np.diag(errors**-2.0) @ depends
    covariance = np.linalg.inv(precision)
    mean = covariance @ depends.T @ (errors**-2.0 * [figure.value for figure in wanted.values()])
    deviation = np.sqrt(np.diag(covariance))
    size = 1.0 / np.square(w).sum()
    assert size > 40.0
    centre = w @ scores
    spread = np.sqrt(w @ (scores - centre) ** 2)
    # Four standard errors of a mean, of twenty.
    assert np.abs((centre - mean) / deviation).max() < 4.0 / np.sqrt(size)
    assert spread / deviation == pytest.approx(1.0, abs=0.5)


def test_no_prior_rests_on_what_is_conditioned_on_or_predicted():
    assert not any("fitted" in prior.origin for prior in paper_model.PRIORS)
