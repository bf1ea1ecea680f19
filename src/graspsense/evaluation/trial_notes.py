"""What makes an evaluation of trials less than it seems: small labels, few instances, labels recorded in blocks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import groupby

import numpy as np

from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import counted
from graspsense.core.values.label_text import alike_words, spelled_alike
from graspsense.evaluation.intervals import MIN_INSTANCES


def notes_on(trials: Labelled, k: int) -> Iterator[str]:
    """Yield what a reader must know of these trials, which are evaluated in `k` folds."""
    yield from _on_small_labels(trials, k)
    yield from _on_instances(trials)
    yield from _on_blocks(trials)


def _on_small_labels(trials: Labelled, k: int) -> Iterator[str]:
    counts = Counter(trials.labels)
    single = sorted(label for label, n in counts.items() if n == 1)
    few = sorted(label for label, n in counts.items() if 1 < n < k)
    if single:
        yield f"labels with a single trial, which no fold can predict: {', '.join(single)}"
    if few:
        yield f"labels with fewer trials than folds ({k}): {', '.join(few)}"


def _on_instances(trials: Labelled) -> Iterator[str]:
    """Note what makes the instances of these trials less than other objects."""
    if trials.instances is None:
        return
    count = len(set(trials.instances))
    if count < MIN_INSTANCES:
        yield (
            f"{counted(count, 'instance')}: with fewer than {MIN_INSTANCES}, rates and differences have "
            "no interval, and the controls give no warning"
        )
    if count == len(trials.labels) and not trials.provenance.get("simulated"):
        yield (
            "each trial has an instance of its own: if these are numbers of trials, grasps of the same object are "
            "in training and test, and the rate is not that of other objects"
        )
    if pairs := spelled_alike(trials.instances):
        yield (
            f"instances that differ in spelling only count as two: {alike_words(pairs)}. If they are one object, its "
            "grasps are in training and test"
        )


def _on_blocks(trials: Labelled) -> Iterator[str]:
    """Note that drift can tell recorded labels, and that no control shows it, where each label is one block."""
    order = trials.order
    if order is None or trials.provenance.get("simulated"):
        return
    in_time = [trials.labels[i] for i in np.argsort(order, kind="stable").tolist()]
    blocks = sum(1 for _ in groupby(in_time))
    if blocks == len(set(in_time)) < len(in_time):
        yield (
            "in the order of recording, the trials of each label are one block: what changes with time, such as a "
            "temperature or the zero of a sensor, may tell the labels, and recording_order cannot show it. Grasp "
            "the objects in turn"
        )
