"""Trials without a grasp: small recordings with known ticks, kept in a store, for tests."""

import json
from math import inf, nan

from graspsense.core.signals import CELLS, EFFORT, Command, Frame, Pads
from graspsense.recording.layout import DEVICE, PADS, START, TICK, TRIAL
from graspsense.recording.trial_record import Beginning, Ending, Row
from graspsense.recording.writer import RecordingFile
from graspsense.store.recover import facts_of

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
DEVICE_JSON = {"name": "bench", "serial": "S1", "rate_hz": 1000.0, "clock": "device", "calibration": {}}
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


def beginning(label="can:full_open", instance=None, origin="collect", settings=SETTINGS):
    labels = {"label": label, **({"instance": instance} if instance else {})} if label else {}
    return Beginning(
        made_at="2026-11-21T10:30:15.123+00:00",
        origin=origin,
        labels=labels,
        settings=settings,
        provenance={"config_sha256": "0" * 64, "seed": 3},
    )


def ending(outcome="steady", values=(0.066, 5.5)):
    reasons = {name: "not there" for (name, _), value in zip(FEATURES, values, strict=True) if value is None}
    return Ending(
        trial={"outcome": outcome, "reason": ""},
        features=Row(features=FEATURES, values=values, reasons=reasons),
        before=Row(features=BEFORE, values=(0.08,)),
    )


def write_recording(path, ticks=120, start=None, end=None, finish=True):
    """Write a recording of so many ticks, with the metadata of this beginning and ending; return the file."""
    file = RecordingFile(path)
    file.metadata(START, (start or beginning()).as_metadata())
    file.metadata(DEVICE, {"device": json.dumps(DEVICE_JSON)})
    for k in range(ticks):
        image = pads(k)
        if k == 0 or pads(k - 1).counter != image.counter:
            file.pads(image.t_s, PADS.pack(image.t_s, image.counter, *image.left, *image.right))
        file.tick(frame(k).t_s, TICK.pack(*frame(k), 3, *command(k)))
    if end is not None:
        file.metadata(TRIAL, end.as_metadata())
    if finish:
        file.finish()
    return file


def keep(
    store, label="can:full_open", instance=None, outcome="steady", values=(0.066, 5.5), ticks=120, **more
):
    """Keep a small trial and return its number."""
    start, end = beginning(label, instance, **more), ending(outcome, values)
    path = store.new_recording(start.made_at)
    write_recording(path, ticks, start, end)
    return store.add(start, end, DEVICE_JSON, facts_of(path, ticks, 3))
