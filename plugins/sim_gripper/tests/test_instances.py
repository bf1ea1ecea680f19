import re

import pytest
from attrs import evolve
from cases import every_case
from unverified import sample, unverified_setup

from graspsense.core.values.errors import UnknownName
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.sensing import with_listed_cells
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.build import build
from graspsense_sim_gripper.run.problem import GraspController
from graspsense_sim_gripper.scene.library import find, split_number


def drawn(name, seed):
    plain, number = split_number(name)
    return sample(find(plain), seed, number)


def test_a_numbered_thing_is_the_same_in_every_trial_and_state_but_placed_anew():
    bottle, again = drawn("odwalla:full_open#3", 1), drawn("odwalla:full_open#3", 2)
    empty, naked = drawn("odwalla:empty_open#3", 5), drawn("naked:full_open#3", 1)

    assert bottle.width_m == again.width_m == empty.width_m
    assert bottle.terms == again.terms
    assert (bottle.offset_m, bottle.share) != (again.offset_m, again.share)
    # Draws further out than two standard deviations are clipped to one width; the others all differ.
    assert len({drawn(f"odwalla:full_open#{k}", 1).width_m for k in range(20)}) >= 18
    deviations = {(each.width_m - each.spec.width_m) / each.spec.width_spread_m for each in (bottle, naked)}
    assert len(deviations) == 2


def test_the_number_changes_nothing_else_of_a_trial():
    with_number, without = (
        unverified_setup(SimConfig(), name, 7) for name in ("can:full_open#2", "can:full_open")
    )

    assert with_listed_cells(with_number.sensor) == with_listed_cells(without.sensor)
    assert with_number.plant.drive == without.plant.drive
    assert with_number.state.contact.offset_m == without.state.contact.offset_m
    assert with_number.plant.object.width_m != without.plant.object.width_m


def test_a_numbered_instance_has_the_model_of_all_of_its_kind():
    config = SimConfig(object="toy#2", spread=False, sensor="ideal")
    controller = GraspController(create("controller", "hybrid"), RunConfig())
    numbered, other = (select(build(config, name), controller) for name in ("toy#2", "toy#3"))
    spread = select(build(evolve(config, spread=True), "toy"), controller)
    assert numbered is other is spread


@every_case("name", ["can:full_open#", "can:full_open#x", "can:full_open#-1", "can:full_open#1.5"])
def test_a_wrong_number_is_refused(name):
    with pytest.raises(UnknownName, match=re.escape(repr(name))):
        unverified_setup(SimConfig(), name, 0)
