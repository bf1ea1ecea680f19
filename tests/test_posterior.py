"""The posterior of the simulator's uncertain figures: the model of the paper's trials, and the published page."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("graspsense_sim_gripper", reason="the paper is done again in simulation")
pytest.importorskip("graspsense_c45", reason="the paper's classifier")

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benchmarks"))
import paper_model  # noqa: E402
import posterior_page  # noqa: E402

VALUES = {
    **{prior.name: float(prior.distribution().median()) for prior in paper_model.PRIORS},
    **dict.fromkeys(paper_model.EXPLANATIONS, 0.2),
}


def scene(name, force_n=20.0, node=0.0, **values):
    return tomllib.loads(paper_model.scene_of(name, {**VALUES, **values}, force_n, node))


def test_the_page_is_that_of_the_result():
    result = json.loads((ROOT / "docs" / "posterior.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs" / "posterior.md").read_text(encoding="utf-8")
    assert page == posterior_page.page(result), "run: python benchmarks/posterior.py --out ... --markdown"
    assert set(result["figures"]) == set(paper_model.NAMES)
    assert set(result["conditioned_on"]) == set(paper_model.observed())


@pytest.mark.parametrize("name", paper_model.EXPLANATIONS)
def test_an_explanation_below_the_middle_is_absent_and_at_one_has_its_full_strength(name):
    one = paper_model.EXPLANATIONS[name]
    assert paper_model.strength(name, {name: 0.49}) == one.absent
    assert paper_model.strength(name, {name: 1.0}) == pytest.approx(one.limit)


def test_pressure_changes_the_share_in_closed_containers_with_the_force():
    off, weak, strong = (
        scene("odwalla:full_closed", force_n, pressure=on)["share"]
        for force_n, on in ((23.0, 0.0), (17.0, 1.0), (23.0, 1.0))
    )
    assert off < weak < strong
    assert scene("odwalla:full_open", 23.0, pressure=1.0)["share"] == off


def test_later_squeezes_of_a_placement_are_better_centred():
    first, second, third = (scene("can:full_open", force_n, order=0.75) for force_n in paper_model.FORCES_N)
    assert second["offset_spread_m"] == pytest.approx(first["offset_spread_m"] / 2)
    assert third["offset_spread_m"] == pytest.approx(first["offset_spread_m"] / 4)
    assert scene("can:full_open", 23.0)["offset_spread_m"] == VALUES["offset_spread_m"]


def test_placements_differ_in_stiffness_as_their_spread_says():
    spread = sum(share * node**2 for node, share in paper_model.PLACEMENT_NODES)
    assert spread == pytest.approx(1.0)
    soft, stiff = (scene("odwalla:empty_open", node=node, placement_spread=0.1) for node in (0.0, 1.0))
    assert stiff["terms"][0]["k1_n_m"] / soft["terms"][0]["k1_n_m"] == pytest.approx(1.10517, abs=1e-4)


def test_no_prior_rests_on_what_is_conditioned_on_or_predicted():
    assert not any("fitted" in prior.origin for prior in paper_model.PRIORS)
