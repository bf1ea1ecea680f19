"""Our components conform, the PR2's in emulation, and so do our distributions; some have tests of their own for it."""

import pytest
from grippers import bottle, squeezing

from graspsense.core.components.registry import installed
from graspsense.sources.recordings.grasp_csv import named
from graspsense.testing import examine


def recording(folder):
    lines = ["t;gap;left;right"]
    for k in range(220):
        left, right = bottle(k * 0.01)
        lines.append(f"{k * 0.01:.6f};{squeezing(k * 0.01):.9g};{left:.9g};{right:.9g}")
    path = folder / "squeeze.csv"
    path.write_text("\n".join(lines) + "\n")
    return "csv:" + named(str(path), {"time": ["t"], "gap": ["gap"], "force": ["left", "right"]})


FEW = {
    "graspsense/forest": {"trees": 5},
    "graspsense/extra-trees": {"trees": 5},
    "graspsense/boosted": {"stages": 10},
    "graspsense/backprop": {"epochs": 50},
    "graspsense/ebm": {"bags": 1, "pairs": 1},
}
"""Settings of classifiers with which their training takes less."""


def settings(name, folder):
    if name in FEW:
        return {"keys": FEW[name]}
    if name == "graspsense/replay":
        return {"keys": {"recording": recording(folder)}}
    if name == "graspsense-pr2-gripper/pr2":
        return {
            # That the steps of its body are exact for each object is checked with the simulator itself.
            "keys": {"transport": "emulated", "body_config": {"fidelity": "fixed"}},
            "unplugged": {"faults": {"unplug_at_s": 0.5}},
            "absent": {"transport": "hidraw", "serial": "not there", "body_config": {}},
        }
    return {}


EXAMINED_BY_THEMSELVES = {
    f"graspsense-{name}"
    for name in ("franka-hand", "lerobot", "mujoco-gripper", "robotiq-2f", "romano", "ros2", "so101-gripper")
}
"""Distributions whose own tests run every check."""


def components():
    ours = [
        component for component in installed().components() if component.distribution.startswith("graspsense")
    ]
    return [our.qualified for our in ours if our.distribution not in EXAMINED_BY_THEMSELVES]


@pytest.mark.slow
@pytest.mark.parametrize("name", components())
def test_a_component_of_ours_conforms(name, tmp_path):
    report = examine(name, **settings(name, tmp_path)).report()

    assert report.failures == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", sorted({*(name.partition("/")[0] for name in components()), "graspsense-ros2"})
)
def test_a_distribution_of_ours_conforms(name):
    examined = examine(name, wheel=False)  # .ci/run builds the wheels and runs from them
    examined.subjects = examined.subjects[:1]

    assert examined.report().failures == []


def test_the_recorded_gripper_conforms(tmp_path):
    assert examine("replay", keys={"recording": recording(tmp_path)}).report().failures == []
