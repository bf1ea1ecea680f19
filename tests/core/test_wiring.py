"""Whether components fit is told from their entries, all misfits at once, both sides named."""

import sys

import pytest
from cases import every_case
from parts import CHANNELS_OF_HAND, Hand, HandConfig, Law, LawConfig, channels, offering

from graspsense import load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import WiringError
from graspsense.plugin_api import (
    Channel,
    Controller,
    ControllerEntry,
    SensorBackend,
    SensorBackendEntry,
)

HERE = sys.modules[__name__]

PARTS = """
    from attrs import frozen
    from graspsense.plugin_api import Channel, ControllerEntry, FeatureSetEntry, SensorBackendEntry, hookimpl
    from graspsense.plugin_api import FastChannel, TactileArray

    GRASPSENSE_API = (2, 0)

    @frozen
    class Empty:
        pass

    def entry(kind, name, **more):
        target, config = "no_driver_here:Nothing", "wiring_parts:Empty"
        return kind(name=name, target=target, config=config, summary="", **more)

    GAP, SHAKE = Channel("gap", "m"), FastChannel("shake", "m/s2", samples=1, axes=("x", "y"))
    FAST = (Channel("gap", "m", 1000.0), Channel("velocity", "m/s", 1000.0),
            Channel("force_left", "N", 24.0), Channel("force_right", "N", 24.0), Channel("heat", "K", 1.0))

    @hookimpl
    def graspsense_sensor_backends():
        yield entry(SensorBackendEntry, "full", channels=FAST, accepts=("effort", "velocity"))
        yield entry(SensorBackendEntry, "bare", channels=(GAP,), accepts=("force",))
        more = (FastChannel("shake", "m/s2", samples=8, axes=("x", "y")), TactileArray("palm", "N", rows=2, columns=3))
        yield entry(SensorBackendEntry, "rich", channels=(*FAST, *more), accepts=("velocity",))
        yield entry(SensorBackendEntry, "mute", channels=(), accepts=())

    @hookimpl
    def graspsense_controllers():
        yield entry(ControllerEntry, "gap-only", requires=(GAP,), commands=("velocity",))
        yield entry(ControllerEntry, "shaking", requires=(SHAKE,), commands=("velocity",))
        force = Channel("force_left", "N", 24.0)
        yield entry(ControllerEntry, "both", requires=(force,), commands=("effort", "velocity"))
        yield entry(ControllerEntry, "still", requires=(), commands=())
        yield entry(ControllerEntry, "fast", requires=(Channel("gap", "m", 500.0),), commands=("position",))

    @hookimpl
    def graspsense_feature_sets():
        needed = {"shaken": SHAKE, "narrow": FastChannel("shake", "m/s2", axes=("x",)), "scalar": Channel("palm", "N"),
                  "rapid": Channel("force_left", "N", 100.0), "celsius": Channel("heat", "degC")}
        for name, channel in needed.items():
            yield entry(FeatureSetEntry, name, requires=(channel,), features=())
        yield entry(FeatureSetEntry, "nothing", requires=(), features=())
"""


def said_of(check, *arguments, **named):
    """Return what is said of components that do not fit together, or nothing."""
    try:
        check(*arguments, **named)
    except WiringError as error:
        return str(error)
    return ""


@pytest.fixture
def misfit(site):
    site.write(wiring_parts=PARTS)
    import wiring_parts

    with IsolatedPlugins() as plugins:
        plugins.add(wiring_parts, "lab")

        def misfit(gripper: str, controller: str, features: str) -> str:
            chosen = {
                "gripper": gripper,
                "controller": controller,
                "features": features,
                "classifier": "none",
            }
            flags = [Flag(f"--{table}", f"{table}.type", name) for table, name in chosen.items()]
            said = said_of(check, resolve(flags=flags))
            assert "no_driver_here" not in sys.modules
            return said

        yield misfit


RAPID = "features lab/rapid needs the channel 'force_left' in N at 100 Hz or more, "


@every_case(
    ("gripper", "controller", "features", "says", "choices"),
    [
        ("mute", "still", "rapid", RAPID + "which gripper lab/mute does not have (it has: none)", "features"),
        ("full", "still", "rapid", RAPID + "but gripper lab/full gives it at 24 Hz", "features"),
        ("full", "still", "celsius", "'heat' in degC, but gripper lab/full", "features"),
        ("full", "fast", "nothing", "commands position, which gripper lab/full", "controller"),
    ],
)
def test_one_misfit_is_told_with_what_to_choose(misfit, gripper, controller, features, says, choices):
    head, told, grippers, others = misfit(gripper, controller, features).splitlines()
    assert head == "the components do not fit together:"
    assert says in told
    assert f"lab/{controller} and" in grippers
    assert grippers.endswith("none is installed")
    assert f"{choices}.type" in others


def test_what_would_fit_is_listed_for_each_part(misfit):
    grippers, laws, features = misfit("mute", "both", "chitta").splitlines()[-3:]
    others = grippers.rpartition(": ")[2].split(", ")
    assert "lab/full" in others
    assert "lab/bare" not in others
    assert "lab/still" in laws
    assert "lab/both" not in laws.partition(": ")[2]
    assert "lab/nothing" in features
    assert "lab/rapid" not in features


def test_a_pipeline_for_the_gripper_is_named():
    with pytest.raises(WiringError, match="pipeline=robotiq") as refused:
        load_pipeline("default", options=["gripper.type=robotiq"])
    assert "pipeline=franka" not in str(refused.value)
    # The default law sends velocities to this gripper, and efforts to the simulated one.
    assert "graspsense-sim-gripper/sim" in str(refused.value)


def test_every_misfit_is_told_at_once(misfit):
    said = misfit("bare", "hybrid", "chitta")
    assert said.startswith("the components do not fit together:\n")
    assert [line.split(",")[0].strip() for line in said.splitlines()[1:-3]] == [
        "controller graspsense/hybrid needs the channel 'velocity' in m/s",
        "controller graspsense/hybrid needs the channel 'force_left' in N",
        "controller graspsense/hybrid needs the channel 'force_right' in N",
        "features graspsense/chitta needs the channel 'force_left' in N",
        "features graspsense/chitta needs the channel 'force_right' in N",
        "controller graspsense/hybrid commands effort",
    ]


@every_case(
    ("gripper", "controller", "features", "says"),
    [
        ("full", "both", "nothing", ""),
        ("full", "gap-only", "chitta", ""),
        ("bare", "still", "nothing", ""),
        ("bare", "fast", "nothing", "but gripper lab/bare"),
        ("rich", "still", "shaken", ""),  # features see the samples, whatever their number in a tick
        ("rich", "still", "narrow", "as 1 samples"),
        ("rich", "shaking", "nothing", "as 1 samples"),  # a law reads what comes in a tick
        ("rich", "still", "scalar", "lab/rich gives it as an array of 6 cells"),
    ],
)
def test_channels_of_another_kind_rate_or_shape_are_told(misfit, gripper, controller, features, says):
    told = misfit(gripper, controller, features)
    assert bool(told) == bool(says)
    assert says in told


class Stiff(Hand, SensorBackend[HandConfig]):
    """A gripper that cannot squeeze gently, move slowly, or be moved by little; opening it is an error."""

    channels = channels(*CHANNELS_OF_HAND)
    accepts = ("effort",)
    least_force_n = 25.0
    least_speed_m_s = 0.02
    least_step_m = 0.0004

    def open(self, seed):
        raise AssertionError("it was opened")


class Stepping(Law, Controller[LawConfig]):
    requires = (Channel("gap", "m"),)
    commands = ("effort",)

    def asked_step_m(self):
        return 1e-4


STIFF_PLUGIN = offering(
    SensorBackendEntry(name="stiff", target=f"{__name__}:Stiff", summary="a stiff hand"),
    ControllerEntry(name="stepping", target=f"{__name__}:Stepping", summary="moves in small steps"),
)


@pytest.fixture
def refusal(monkeypatch):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    with IsolatedPlugins(STIFF_PLUGIN) as plugins:
        fixed = ["gripper.type=stiff", "classifier.type=none"]
        yield lambda *options: said_of(load_pipeline, options=[*fixed, *options], plugins=plugins)


FIRST = ("run.first_effort_n=30", "run.first_speed_m_s=0.03")
ASKED = ("controller.probing_force_n=30", "controller.closing_speed_m_s=0.03")


@every_case(
    ("options", "says"),
    [
        ((*FIRST, ASKED[1], "controller.probing_force_n=5"), ["force of 5 N", "25 N"]),
        ((*FIRST, ASKED[0], "controller.closing_speed_m_s=0.01"), ["speed of 10 mm/s", "20 mm/s"]),
        ((*FIRST, "controller.type=stepping"), ["step of 0.1 mm", "0.4 mm"]),
        ((*ASKED, FIRST[1]), ["run.first_effort_n is 12 N", "run.first_effort_n=25"]),
        ((*ASKED, FIRST[0]), ["run.first_speed_m_s is 0.015 m/s", "run.first_speed_m_s=0.02"]),
        ((*ASKED, *FIRST, "run.effort_ceiling_n=9"), ["run.effort_ceiling_n is 9 N"]),
        ((*ASKED, *FIRST), []),
    ],
)
def test_what_a_gripper_cannot_do_gently_is_refused_before_it_is_opened(refusal, options, says):
    told = refusal(*options)
    assert bool(told) == bool(says)
    for words in says:
        assert words in told


def test_a_controller_that_asks_for_no_number_is_named(refusal, monkeypatch):
    monkeypatch.setattr(Stepping, "asked_force_n", lambda _: "much")
    assert "'much'" in refusal(*FIRST, "controller.type=stepping")
