"""The catalogue is complete, strict, and says why for every figure; instances vary as it says."""

import math
import tomllib
from importlib.resources import files
from typing import NamedTuple

import numpy as np
import pytest
from cases import every_case
from unverified import sample

from graspsense.plugin_api import UnknownName
from graspsense.simulator_api import fitted_results
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.scene.instance import cell_weights
from graspsense_sim_gripper.scene.library import catalogue, find
from graspsense_sim_gripper.scene.spec import PATCHES, ObjectSpec
from graspsense_sim_gripper.scene.terms import NoState, Term
from graspsense_sim_gripper.scene.terms.registry import TERMS


def test_the_backend_declares_the_papers_containers_in_all_states_as_its_default_objects():
    kinds = SimBackend(SimConfig()).objects()

    every = ("full_closed", "full_open", "empty_closed", "empty_open")
    can = ("full_closed", "full_open", "empty_open")
    expected = {"odwalla": every, "naked": every, "can": can, "water": every}
    assert {kind.name: kind.states for kind in kinds if kind.default} == expected
    assert {name for kind in kinds for name in kind.full_names} >= {*catalogue(), "sponge"}


KEYS = {
    *("summary", "patch", "width_m", "width_spread_m", "stiffness_spread", "offset_spread_m"),
    *("share", "share_spread", "friction", "mass_kg"),
}
RESULTS = {"table_2", "table_3", "authors_tree", "section_3f", "fig_6_contact"}


def test_every_entry_is_whole_and_every_figure_has_its_origin_and_reason():
    text = files("graspsense_sim_gripper").joinpath("scene/catalogue.toml").read_text(encoding="utf-8")
    tables, numbers = tomllib.loads(text), []

    def read(entry):
        if isinstance(entry, dict) and "value" not in entry:
            entry = list(entry.values())
        if isinstance(entry, list):
            for part in entry:
                read(part)
        elif not isinstance(entry, str):
            numbers.append(entry)

    read(tables)
    assert len(numbers) > 100
    for number in numbers:
        assert number.keys() == {"value", "origin", "reason"}
        assert len(number["reason"]) >= 5
        assert set(fitted_results(number["origin"])) <= RESULTS
    for table in tables.values():
        for state in table.get("states", {"": {}}).values():
            assert {*table, *state} >= KEYS


@every_case(
    ("name", "says"),
    [
        ("odwala:full_open", r"named 'odwala'.*'odwalla'\?"),
        ("odwalla", "'odwalla'.*state: full_closed, full_open, empty_closed, empty_open"),
        ("odwalla:ful_open", r"no state 'ful_open'.*'full_open'\?"),
        ("can:empty_closed", "'can'.*state 'empty_closed'. Known: full_closed, full_open, empty_open"),
        ("block:open", "'block'"),
        ("", r"no object named ''"),
    ],
)
def test_an_unknown_object_or_state_is_answered_with_what_there_is(name, says):
    with pytest.raises(UnknownName, match=says):
        find(name)


def test_without_a_generator_it_is_the_catalogues_own_figures():
    spec = find("toy")
    instance = sample(spec, None)
    assert (instance.width_m, instance.offset_m, instance.share) == (spec.width_m, 0.0, spec.share)
    assert dict(spec.terms)["elastic"]["k1_n_m"] == instance.terms[0].k1_n_m


def test_instances_spread_as_the_catalogue_says():
    spec = find("water:empty_open")
    many = [sample(spec, seed) for seed in range(800)]
    stiffness = np.log([i.terms[0].k1_n_m / 1300.0 for i in many])
    assert np.std(stiffness) == pytest.approx(spec.stiffness_spread, rel=0.06)
    assert np.mean(stiffness) == pytest.approx(0.0, abs=0.03)
    assert np.std([i.width_m for i in many]) == pytest.approx(spec.width_spread_m, rel=0.1)
    assert all(0.0 < i.share <= 1.0 for i in many)


@pytest.mark.parametrize("patch", PATCHES)
def test_the_weights_of_the_cells_share_out_the_whole_force(patch):
    weights = [math.nan] * 15
    cell_weights(PATCHES.index(patch), 0.4, weights)
    assert math.fsum(weights) == pytest.approx(1.0)
    rows = [sum(weights[3 * r : 3 * r + 3]) for r in range(5)]
    if patch == "face":
        assert max(rows) == pytest.approx(min(rows))
    else:
        # Off the middle towards the base by 0.4 of a row: the third row still carries most.
        assert rows.index(max(rows)) == 2


class Whole(NamedTuple):
    k_n_m: float
    scale: float = 2


def test_a_default_written_as_a_whole_number_is_a_figure_like_others(monkeypatch):
    """Compiled for one object it is compiled for all: a whole number there would cut the others' figures off."""
    term = Term(name="whole", summary="", params=Whole, law=lambda *_: (0.0, NoState()))
    monkeypatch.setitem(TERMS, "whole", term)
    spec = ObjectSpec(name="made up", width_m=0.05, terms=(("whole", {"k_n_m": 100}),))
    assert [type(value) for value in sample(spec, None).terms[0]] == [float, float]
