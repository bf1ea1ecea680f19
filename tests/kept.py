"""Trials without a grasp: small recordings with known ticks, added to a store, for tests."""

import tomllib
from math import inf, nan

from attrs import evolve

from graspsense.core.values.signals import EFFORT, Command, Frame, Pads
from graspsense.recording.layout import DEVICE, RESULT, START, TICK, pads_topic
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import DeviceRecord, TrialRecord, TrialResult, stored_features
from graspsense.recording.writer import RecordingWriter
from graspsense.testing.model_gripper import CELLS

SETTINGS = """\
[gripper]
type = "graspsense-sim-gripper/sim"
object = "can:full_open"

[controller]
type = "graspsense/hybrid"
probing_force_n = 20.0

[features]
type = "graspsense/chitta"

[run]
seed = 3
"""
BENCH = DeviceRecord(name="bench", serial="S1", rate_hz=1000.0, clock="virtual", simulated=True)
FEATURES = (("p_first", "m"), ("f_steady", "N"))
BEFORE = (("gap_at_start", "m"),)


def frame(k):
    t = 10.0 + k * 0.001
    return Frame(t, 0.001, 0.08 - k * 1e-5, -0.01, 5.0, k * 0.01, k * 0.02, nan, 0.0, k % 3)


def pads(k):
    image = 1 + k // 41
    cells = tuple(3000.0 + image + i for i in range(CELLS))
    return Pads(10.0 + 0.041 * (image - 1), image, cells, cells[::-1])


def command(k):
    return Command(EFFORT, 0.1 * k, inf, 0.2)


def begun(label="can:full_open", instance=None, origin="collect", settings=SETTINGS, device=BENCH):
    """Return the record of a trial before its grasp."""
    labels = {"label": label, **({"instance": instance} if instance else {})} if label else {}
    return TrialRecord(
        made_at="2026-11-21T10:30:15.123+00:00",
        origin=origin,
        labels=labels,
        settings=tomllib.loads(settings),
        provenance={"config_sha256": "0" * 64, "seed": 3},
        device=device,
    )


def ended(outcome="steady", values=(0.066, 5.5), **more):
    """Return the record of a trial after its grasp."""
    reasons = {name: "not there" for (name, _), value in zip(FEATURES, values, strict=True) if value is None}
    result = TrialResult(
        outcome=outcome,
        features=stored_features(FEATURES, values, reasons),
        before_contact=stored_features(BEFORE, (0.08,), {}),
    )
    return evolve(begun(**more), result=result)


def write_recording(path, ticks=120, record=None, finish=True, grasp=0, **texts):
    """Write a recording of so many ticks, with the sections of this record; return the file.

    Recordings with another `grasp` have another effort. `texts` replace those of the section START.
    """
    record = record or begun()
    file = RecordingWriter(path)
    file.metadata(START, {**record.section(START), **texts})
    file.metadata(DEVICE, record.section(DEVICE))
    layout = pads_topic(CELLS)
    number = file.topic(layout) if ticks else 0
    for k in range(ticks):
        image = pads(k)
        if k == 0 or pads(k - 1).counter != image.counter:
            file.signal(number, layout.wire.pack(image.t_s, image.counter, *image.left, *image.right))
        measured = frame(k)._replace(effort_n=5.0 + grasp)
        file.tick(TICK.pack(*measured, 3, *command(k)))
    if record.result is not None:
        file.metadata(RESULT, record.section(RESULT))
    if finish:
        file.finish()
    return file


def keep(
    store,
    label="can:full_open",
    instance=None,
    outcome="steady",
    values=(0.066, 5.5),
    ticks=120,
    labels=None,
    complete=True,
    grasp=0,
    **more,
):
    """Add a small trial to the store and return its number; `labels` are further ones."""
    record = ended(outcome, values, label=label, instance=instance, **more)
    record = evolve(record, labels={**record.labels, **(labels or {})})
    path = store.new_recording(record.made_at)
    write_recording(path, ticks, record, grasp=grasp)
    return store.add(record, RecordingInfo.hashed(path, ticks, 3), complete=complete)
