"""What cannot be recorded is not kept, and what a label cannot select is not grasped: each is told."""

from __future__ import annotations

import sys

import pytest
from attrs import frozen
from cases import every_case
from commands import graspsense
from parts import ACCELERATION, CHANNELS_OF_HAND, Hand, HandConfig, channels, offering

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.settings.resolved import resolve
from graspsense.plugin_api import Reading, SensorBackend, SensorBackendEntry, setting
from graspsense.recording.reader import read_recorded
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store

HERE = sys.modules[__name__]
PLAIN = ("classifier.type=none", "features.type=chitta")


@frozen(kw_only=True)
class UncountableConfig(HandConfig):
    images: int = setting(default=50, meaning="Images with a counter that is a whole number.")


class Uncountable(Hand, SensorBackend[UncountableConfig]):
    """After some images, their counter is one that no recording can hold."""

    channels = channels(*CHANNELS_OF_HAND)
    accepts = ("effort",)

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        counter = reading.pads.counter
        if counter > self.config.images:
            return reading._replace(pads=reading.pads._replace(counter=float(counter)), signals=())
        return reading._replace(signals=())


@frozen(kw_only=True)
class ShorteningConfig(HandConfig):
    what: str = setting(default="image", meaning="What goes wrong.")


class Shortening(Hand, SensorBackend[ShorteningConfig]):
    """Delivers something else than it declares from 1.5 s on."""

    channels = (*channels(*CHANNELS_OF_HAND), ACCELERATION)
    accepts = ("effort",)

    def read(self, timeout_s):
        frame, pads, signals = super().read(timeout_s)
        if frame.t_s > 1.5:
            frame, pads, signals = SPOILT[self.config.what](frame, pads, signals)
        return Reading(frame, pads, signals)


def short(signals):
    """Return samples of the acceleration with one number instead of three."""
    return signals.acceleration._replace(values=((0.0,),) * 3)


SPOILT = {
    "image": lambda frame, pads, signals: (frame, pads._replace(left=pads.left[:5]), signals),
    "cell": lambda frame, pads, signals: (frame, pads._replace(right=(None,) * 22), signals),
    "rows": lambda frame, pads, signals: (frame, pads, signals._replace(acceleration=short(signals))),
    "frame": lambda frame, pads, signals: (frame._replace(edge_left_n=None), pads, signals),
    "status": lambda frame, pads, signals: (frame._replace(status=1 << 70), pads, signals),
    "signals": lambda frame, pads, signals: (frame, pads, ()),
}


class Thingless(Uncountable):
    """Is simulated, and cannot be told what it holds."""

    opened = commanded = 0

    def objects(self):
        return ()

    def open(self, seed):
        type(self).opened += 1
        return super().open(seed)

    def apply(self, command):
        type(self).commanded += command.value != 0.0
        super().apply(command)


LAB_HAND = offering(
    *(
        SensorBackendEntry(name=cls.__name__.lower(), target=f"{__name__}:{cls.__name__}", summary="a hand")
        for cls in (Uncountable, Thingless, Shortening)
    )
)


@pytest.fixture(autouse=True)
def plugins(monkeypatch):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    with IsolatedPlugins() as plugins:
        plugins.add(LAB_HAND, "lab-hand")
        yield plugins


def plainly(*arguments, answers=""):
    options = [part for option in PLAIN for part in ("-o", option)]
    return graspsense(*arguments, *options, answers=answers)


def numbers_in(folder):
    with Store.read(folder) as store:
        return [summary.id for summary in store.page(set_aside=None)]


@pytest.mark.slow
def test_a_grasp_whose_recorder_fails_is_not_kept_and_its_outcome_says_why(plugins, tmp_path):
    settings = resolve("default", options=["gripper.type=uncountable", *PLAIN], plugins=plugins)
    with Store.open(tmp_path / "t") as store:
        kept = record_grasp(store, settings, plugins, labels={}, origin="run")
    assert kept.number is None
    assert f"of the {len(kept.trial.trace)} ticks" in kept.problem
    assert "graspsense recover" in kept.problem
    assert "Recorder failed: " in kept.trial.reason
    assert numbers_in(tmp_path / "t") == []
    # What was recorded until then can be recovered; it is no trial that counts.
    assert [path.suffix for path in (tmp_path / "t" / "recordings").iterdir()] == [".part"]


@pytest.mark.slow
def test_run_says_in_outcome_and_exit_code_that_the_trial_is_not_kept(tmp_path):
    code, out, err = plainly("run", "--gripper", "uncountable", "--save", str(tmp_path / "t"))
    assert code == 2
    (outcome,) = [line for line in out.splitlines() if line.startswith("outcome")]
    assert "Recorder failed" in outcome
    assert "kept as trial" not in err


@pytest.mark.slow
def test_collect_neither_counts_it_nor_goes_on(tmp_path):
    folder = str(tmp_path / "t")
    command = ("collect", "--labels", "cup:full", "--each", "2", "--save", folder, "--gripper", "uncountable")
    code, out, err = plainly(*command, answers="\n\n")
    assert code != 0
    assert "0 of 2" in out
    assert "the grasp" in err
    assert "Recorder failed" in err
    assert numbers_in(folder) == []


@every_case(
    "command",
    [
        ("collect", "--labels", "cup:full,cup:empty", "--each", "1", "--save"),
        ("run", "--label", "cup:full", "--save"),
    ],
)
def test_a_simulated_gripper_that_cannot_be_told_what_it_holds_grasps_nothing_under_a_label(
    tmp_path, command
):
    Thingless.opened = Thingless.commanded = 0
    code, _, err = plainly(*command, str(tmp_path / "t"), "--gripper", "thingless", answers="\n\n")
    assert code == 2
    assert "with_object" in err
    assert (Thingless.opened, Thingless.commanded) == (1, 0)
    assert numbers_in(tmp_path / "t") == []


@pytest.mark.parametrize(
    "what",
    [pytest.param(what, marks=() if what == "image" else pytest.mark.slow) for what in SPOILT],
)
def test_what_a_gripper_does_not_declare_ends_the_grasp_and_the_trial_until_then_is_kept(tmp_path, what):
    folder = tmp_path / "t"
    more = ("--gripper", "shortening", "-o", f"gripper.what={what}", "--save", str(folder))
    code, out, err = plainly("run", *more)
    assert code == 4, err
    assert "aborted: hand delivered" in out
    with Store.read(folder) as store:
        (trial,) = store.page()
        assert trial.outcome == "aborted"
        assert 500 < len(read_recorded(store.trial(1).recording)) < 1500
