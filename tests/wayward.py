"""A plugin that goes wrong in every way a plugin can, written to a folder for whole processes to find."""

import os
from pathlib import Path

SOURCE = '''
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
from attrs import frozen
from graspsense.plugin_api import Classifier, ClassifierConfig, ClassifierEntry, Prediction, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_classifiers():
    yield ClassifierEntry(
        name="wayward", target="wayward:Wayward", config="wayward:WaywardConfig", summary="goes wrong"
    )


@frozen(kw_only=True)
class WaywardConfig(ClassifierConfig):
    how: str = "fine"


class Unpicklable(Exception):
    def __init__(self, text):
        super().__init__(text)
        self.lock = threading.Lock()


class Wayward(Classifier):
    """Answers the first label, and holds a lock, which nothing can pickle."""

    def __init__(self, config):
        super().__init__(config)
        self.lock = threading.Lock()

    def fit(self, table, labels, seed):
        # Files whose names are not in the code, which would be inputs of every task.
        marks = Path(os.environ["WAYWARD_MARKS"])
        how = "fine" if marks.with_suffix(".tamed").exists() else self.config.how
        self.labels = tuple(sorted(set(labels)))
        mark = marks / f"{how}-{seed}"
        if how == "raises":
            raise Unpicklable("as it is told to")
        if how == "kills" or (how == "kills once" and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if how == "exits":
            raise SystemExit(3)
        if how == "prints":
            print("what a plugin prints is no answer of a worker", flush=True)
        if how == "waits":
            # Until it is told to go on: a task that is being done while something else happens.
            mark.touch()
            while not marks.with_suffix(".go").exists():
                time.sleep(0.02)

    def classes(self):
        return self.labels

    def probabilities(self, table):
        found = np.zeros((len(table), len(self.labels)))
        found[:, 0] = 1.0
        return found

    def explain(self, features):
        return Prediction(label=self.labels[0], probabilities={self.labels[0]: 1.0}, because=())

    def to_json(self):
        return {}

    def from_json(self, model):
        self.labels = ()
'''


def install(folder: Path) -> dict[str, str]:
    """Write the plugin into this folder and return the environment in which processes find it."""
    info = folder / "wayward-0.3.dist-info"
    info.mkdir(parents=True)
    (folder / "wayward.py").write_text(SOURCE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: wayward\nVersion: 0.3\n")
    (info / "entry_points.txt").write_text("[graspsense.plugins]\nmain = wayward\n")
    marks = folder / "marks"
    marks.mkdir()
    return {**os.environ, "PYTHONPATH": str(folder), "WAYWARD_MARKS": str(marks), "NO_COLOR": "1"}


CSV = "what,p_first [m],f_steady [N]\n" + "".join(
    f"{'ab'[i % 2]},{0.05 + 0.001 * ((7 * i) % 11) + 0.004 * (i % 2):.4f},{3.0 + (5 * i) % 7 + 2 * (i % 2):.1f}\n"
    for i in range(40)
)
"""Forty trials of two labels that overlap."""
