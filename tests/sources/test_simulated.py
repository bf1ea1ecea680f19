"""Whether a trial is simulated is what the gripper declares at each opening, whatever its settings are called."""

from __future__ import annotations

import re
import sys

import pytest
from attrs import evolve, frozen
from parts import CHANNELS_OF_HAND, Hand, HandConfig, channels, offering

from graspsense import load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError
from graspsense.plugin_api import ObjectKind, SensorBackend, SensorBackendEntry, setting
from graspsense.sources.simulated import Group, plan_trials, simulated
from graspsense.store.dataset import labelled_store
from graspsense.store.labels import labels_of
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store

HERE = sys.modules[__name__]


@frozen(kw_only=True)
class TcpHandConfig(HandConfig):
    object: str = setting(default="workpiece 7", meaning="What the fingers are made for.")
    emulated: bool = setting(default=False, meaning="Whether a model answers instead of the gripper.")


class TcpHand(Hand, SensorBackend[TcpHandConfig]):
    channels = channels(*CHANNELS_OF_HAND)
    accepts = ("effort",)

    def objects(self):
        return ()

    def open(self, seed):
        return evolve(super().open(seed), simulated=self.config.emulated)


LAB_HAND = offering(
    SensorBackendEntry(name="tcp-hand", target=f"{__name__}:TcpHand", summary="a hand on a socket")
)


@pytest.mark.slow
@pytest.mark.parametrize("emulated", [False, True])
def test_a_trial_is_simulated_where_the_gripper_says_so_and_not_by_its_settings(
    tmp_path, monkeypatch, emulated
):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    hand = ["gripper.type=tcp-hand", f"gripper.emulated={str(emulated).lower()}", "run.hold_s=0.01"]
    options = [*hand, "controller.closing_speed_m_s=0.04", "run.first_speed_m_s=0.1", "classifier.type=none"]
    with IsolatedPlugins() as plugins, Store.open(tmp_path / "trials") as store:
        plugins.add(LAB_HAND, "lab-hand")
        settings = load_pipeline(options=options, plugins=plugins).settings
        record_grasp(store, settings, plugins, labels=labels_of("cup:full"), origin="run")

        assert [summary.simulated for summary in store.page()] == [emulated]
    assert labelled_store(str(tmp_path / "trials")).provenance["simulated"] is emulated


def test_a_group_may_name_its_objects_by_label_alone():
    settings = load_pipeline(options=["gripper.type=sim", "classifier.type=none"]).settings
    group = Group(named={"odwalla:full_open": "odwalla_worn:full_open"}, instances=2, trials=1)
    assert plan_trials(settings, [group], 0).labels == ("odwalla:full_open",) * 2


def test_a_gripper_without_default_objects_names_those_that_can_be_given(monkeypatch):
    monkeypatch.setattr(
        "graspsense.sources.simulated.simulated_objects", lambda settings: (ObjectKind(name="foam"),)
    )
    settings = load_pipeline(options=["gripper.type=sim", "classifier.type=none"]).settings
    with pytest.raises(ConfigError, match=r"foam$"):
        plan_trials(settings, [Group(instances=2, trials=1)], 0)


@pytest.mark.slow
def test_many_trials_are_run_in_parts_of_equal_size_and_only_their_numbers_are_kept(monkeypatch):
    settings = resolve("default", options=["gripper.sensor=ideal"])
    group = Group(objects=("block",), instances=1, trials=5)
    whole = simulated(settings, groups=[group])

    monkeypatch.setattr("graspsense.sources.simulated.BATCH_WITHOUT_TRACES", 2)
    in_parts = simulated(settings, groups=[group])

    assert in_parts.table.values.tobytes() == whole.table.values.tobytes()
    assert in_parts.before_contact.table.values.tobytes() == whole.before_contact.table.values.tobytes()
    assert (in_parts.labels, in_parts.table.names) == (whole.labels, whole.table.names)


@pytest.mark.slow
def test_a_note_says_in_how_many_grasps_of_which_objects_the_accuracy_is_not_verified(tmp_path):
    rod = tmp_path / "rod.toml"
    rod.write_text('width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 1e7\n')
    settings = resolve("default", options=["gripper.pad_stiffness_n_m=inf", "gripper.sensor=ideal"])
    groups = [Group(objects=("egg",), named={"rod:steel": str(rod)}, instances=2, trials=1)]

    notes = simulated(settings, groups=groups).notes

    (note,) = [note for note in notes if "not verified" in note]
    assert re.match(r"2 of 4 grasps \(rod:steel\): .* trace, features .*--explain-model", note)
