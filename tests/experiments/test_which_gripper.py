"""The shipped experiment with every gripper: each entry grasps, and the pages have the tables of all of them."""

import pytest
from cases import every_case
from repository import ROOT

from graspsense.core.grasp.runner import run_grasp
from graspsense.core.pipeline.wiring import check
from graspsense.experiments.experiment_file import read_plan

CASES = read_plan("which_gripper").cases
PAGE = (ROOT / "docs" / "which_gripper.md").read_text(encoding="utf-8")
THINGS = (ROOT / "benchmarks" / "results" / "which_gripper.md").read_text(encoding="utf-8")


@every_case("case", CASES)
def test_each_gripper_of_the_experiment_fits_its_settings_and_is_told_what_to_hold(case):
    check(case.settings)
    assert case.settings.gripper.create().objects()


@pytest.mark.slow
@every_case("case", CASES)
def test_each_gripper_grasps_the_things_of_the_experiment(case):
    settings = case.settings
    gripper = settings.gripper.create().with_object("block")
    grasp = run_grasp(gripper, settings.controller.create(), settings.run)
    assert grasp.outcome.words == "steady", grasp.reason
    assert not settings.features.create().extract(grasp.trace).reasons


def test_the_pages_have_a_row_for_each_gripper_and_for_each_thing():
    for case in CASES:
        assert PAGE.count(f"| {case.name} |") == THINGS.count(f"| {case.name} |") == 1, (
            "run `graspsense experiment which_gripper` and the page's script"
        )
    for thing in CASES[0].data.objects:
        assert f"| `{thing}` |" in THINGS
