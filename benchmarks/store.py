"""How fast a store of 100 000 trials is searched, read as a table, and predicted on.

    python benchmarks/store.py [--trials 100000] [--short]

The rows are made up and their recordings are not there: what is timed is the database. The time of a command is
that of the work in a process that has started; the median of several.
"""

from __future__ import annotations

import random
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from arguments import parser_of

from graspsense.core.components.registry import installed
from graspsense.core.learn.training import train
from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import create
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import DeviceRecord, TrialRecord, TrialResult, stored_features
from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store

LABELS = ("can:full_open", "can:empty_open", "odwalla:full_closed", "odwalla:full_open", "odwalla:empty_open")
FEATURES = (
    ("p_first", "m"),
    ("p_steady", "m"),
    ("f_steady", "N"),
    ("delta_t", "s"),
    ("dp_dt", "m/s"),
    ("df_dt", "N/s"),
)
BEFORE = (("gap_at_start", "m"), ("velocity_before", "m/s"), ("effort_before", "N"))
REPEATS = 5


def fill(store: Store, trials: int) -> None:
    """Write so many trials, each in its own transaction."""
    rng = random.Random(1)
    # The store's own transaction is one a trial; to fill it in reasonable time the disk need not follow each.
    store._connection.execute("PRAGMA synchronous = OFF")
    for k in range(trials):
        label = LABELS[k % len(LABELS)]
        values = tuple(rng.gauss(LABELS.index(label), 0.3) for _ in FEATURES)
        record = TrialRecord(
            made_at=f"2026-{1 + k % 12:02d}-{1 + k % 28:02d}T10:00:00.000+00:00",
            origin="collect",
            labels={"label": label, "instance": f"{label.partition(':')[0]}#{k % 40}"},
            settings={
                "gripper": {"type": "graspsense-sim-gripper/sim", "object": label},
                "run": {"seed": k},
            },
            provenance={"config_sha256": "0" * 64, "seed": k, "components": {}, "note": "x" * 600},
            device=DeviceRecord(serial=f"S{k % 3}", simulated=True),
            result=TrialResult(
                outcome="steady" if k % 50 else "slipped",
                features=stored_features(FEATURES, values, {}),
                before_contact=stored_features(BEFORE, (0.08, -0.01, 10.0), {}),
                details={"events": ["x" * 60] * 20},
            ),
        )
        path = store.recordings / f"{k:08d}.mcap"
        store.add(record, RecordingInfo(path=path, sha256="0" * 64, size=300_000, ticks=7000, images=0))


def median_s(work: Callable[[], object]) -> float:
    """Return the median time of several runs."""
    taken = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--trials", type=int, default=100_000)
    given = parser.parse_args()
    if given.short:
        given.trials = 2_000
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with Store.open(folder) as store:
            fill(store, given.trials)
        print(f"{given.trials} trials; {where_measured()}")
        for name, value in measured(folder).items():
            print(f"{name:<24}{value:.4f} s")


def measured(folder: Path) -> dict[str, float]:
    """Return the time of each kind of work."""
    component, config = installed().find("classifier", "c45"), create("classifier", "c45").config
    few = labelled_store(str(folder)).rows(np.arange(2000))
    model = train(component, config, few, name="benchmark")

    def page(label: str) -> list[object]:
        with Store.read(folder) as store:
            return store.page(label=label)

    return {
        "page": median_s(lambda: page(LABELS[0])),
        "page without a hit": median_s(lambda: page("no such label")),
        "table": median_s(lambda: labelled_store(str(folder))),
        "predict (c45)": median_s(lambda: model.answers(labelled_store(str(folder)).table)),
    }


if __name__ == "__main__":
    main()
