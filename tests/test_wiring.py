"""Whether components fit is told from their entries, all misfits at once, both sides named."""

from __future__ import annotations

import sys

import pytest

from graspsense.core.components.config import Flag, resolve
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.pipeline.wiring import check
from graspsense.core.values.errors import WiringError

PARTS = """
    from attrs import frozen
    from graspsense.plugin_api import Channel, ControllerEntry, FeatureSetEntry, SensorBackendEntry, hookimpl

    GRASPSENSE_API = (2, 0)

    @frozen
    class Empty:
        pass

    def entry(kind, name, **more):
        target, config = "no_driver_here:Nothing", "wiring_parts:Empty"
        return kind(name=name, target=target, config=config, summary="", **more)

    FAST = (Channel("gap", "m", 1000.0), Channel("velocity", "m/s", 1000.0),
            Channel("force_left", "N", 24.0), Channel("force_right", "N", 24.0), Channel("heat", "K", 1.0))

    @hookimpl
    def graspsense_sensor_backends():
        yield entry(SensorBackendEntry, "full", channels=FAST, accepts=("effort", "velocity"))
        yield entry(SensorBackendEntry, "bare", channels=(Channel("gap", "m"),), accepts=("position",))
        yield entry(SensorBackendEntry, "mute", channels=(), accepts=())

    @hookimpl
    def graspsense_controllers():
        yield entry(ControllerEntry, "gap-only", requires=(Channel("gap", "m"),), commands=("velocity",))
        force = Channel("force_left", "N", 24.0)
        yield entry(ControllerEntry, "both", requires=(force,), commands=("effort", "velocity"))
        yield entry(ControllerEntry, "still", requires=(), commands=())
        yield entry(ControllerEntry, "fast", requires=(Channel("gap", "m", 500.0),), commands=("position",))

    @hookimpl
    def graspsense_feature_sets():
        yield entry(FeatureSetEntry, "rapid", requires=(Channel("force_left", "N", 100.0),), features=())
        yield entry(FeatureSetEntry, "celsius", requires=(Channel("heat", "degC"),), features=())
        yield entry(FeatureSetEntry, "nothing", requires=(), features=())
"""


@pytest.fixture
def misfit(site):
    site.write(wiring_parts=PARTS)
    import wiring_parts

    with IsolatedPlugins() as plugins:
        plugins.add(wiring_parts, "lab")

        def misfit(gripper: str, controller: str, features: str) -> str:
            flags = [
                Flag("--gripper", "gripper.type", gripper),
                Flag("--controller", "controller.type", controller),
                Flag("--features", "features.type", features),
                Flag("--classifier", "classifier.type", "none"),
            ]
            try:
                check(resolve(flags=flags))
            except WiringError as error:
                return str(error)
            finally:
                assert "no_driver_here" not in sys.modules
            return ""

        yield misfit


@pytest.mark.parametrize(
    ("gripper", "controller", "features"),
    [("full", "both", "nothing"), ("full", "gap-only", "chitta"), ("bare", "still", "nothing")],
)
def test_what_fits_passes(misfit, gripper, controller, features):
    assert misfit(gripper, controller, features) == ""


def test_a_missing_channel(misfit):
    assert (
        misfit("mute", "still", "rapid")
        == """\
two components do not fit together:
  features lab/rapid needs the channel 'force_left' in N at 100 Hz or more, which gripper lab/mute \
does not have (it has: none). Choose another gripper.type or features.type (graspsense plugins list)
  No other installed gripper offers what controller lab/still and features lab/rapid need"""
    )


def test_a_rate_that_is_too_low(misfit):
    assert (
        misfit("full", "still", "rapid")
        == """\
two components do not fit together:
  features lab/rapid needs the channel 'force_left' in N at 100 Hz or more, but gripper lab/full gives it at \
24 Hz. Choose another gripper.type or features.type (graspsense plugins list)
  No other installed gripper offers what controller lab/still and features lab/rapid need"""
    )


def test_a_rate_that_nobody_promises(misfit):
    assert "but gripper lab/bare gives it at no promised rate." in misfit("bare", "fast", "nothing")


def test_another_unit(misfit):
    assert (
        misfit("full", "still", "celsius")
        == """\
two components do not fit together:
  features lab/celsius needs the channel 'heat' in degC, but gripper lab/full gives it in K. \
Choose another gripper.type or features.type (graspsense plugins list)
  No other installed gripper offers what controller lab/still and features lab/celsius need"""
    )


def test_a_command_that_is_not_taken(misfit):
    assert (
        misfit("full", "fast", "nothing")
        == """\
two components do not fit together:
  controller lab/fast commands position, which gripper lab/full does not take (it takes: effort, velocity). \
Choose another gripper.type or controller.type (graspsense plugins list)
  No other installed gripper offers what controller lab/fast and features lab/nothing need"""
    )


def test_installed_grippers_that_would_fit_are_listed(misfit):
    last = misfit("mute", "both", "chitta").splitlines()[-1].strip()
    needed = "Installed grippers that offer what controller lab/both and features graspsense/chitta need: "
    assert last.startswith(needed)
    assert "lab/full" in last.removeprefix(needed).split(", ")
    assert "lab/bare" not in last


def test_every_misfit_is_told_at_once(misfit):
    said = misfit("bare", "hybrid", "chitta")

    assert said.startswith("the components do not fit together:\n")
    assert [line.split(",")[0].strip() for line in said.splitlines()[1:-1]] == [
        "controller graspsense/hybrid needs the channel 'velocity' in m/s",
        "controller graspsense/hybrid needs the channel 'force_left' in N",
        "controller graspsense/hybrid needs the channel 'force_right' in N",
        "features graspsense/chitta needs the channel 'force_left' in N",
        "features graspsense/chitta needs the channel 'force_right' in N",
        "controller graspsense/hybrid commands effort",
    ]
