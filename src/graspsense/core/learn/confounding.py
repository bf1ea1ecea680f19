"""What differs between the trials of one label and of another besides the object, so that nothing tells which is told.

A label that was always recorded with its own setting, or in its own session, is recognised by that too. So is one that
was recorded in one stretch, by what changed before the next one. How often the object is recognised without it, no
held-out trials of the same recordings tell.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.components.caller import option
from graspsense.core.learn.conformal import exchangeable_instances
from graspsense.core.learn.groups import beyond_chance, is_sorted, means_of

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled

LEAST_LINES: Final = 5
"""Trials from which on their values can show more than chance."""
_IN_TURNS: Final = 1.5
"""Mean number of equal stretches of a label above which labels are in turns: two of each, or of more than half."""
_BLOCKS: Final = 10
"""Blocks of each label, in time, in which its trials count, and most values of a feature that was set."""
_DRIFT: Final = 5.0
"""Standard deviations by which features follow the time within all labels more than in random order, if they drift."""


def confounded(labelled: Labelled) -> str:
    """Return why these trials do not tell how often answers are right; empty if nothing shows it, or if simulated."""
    if labelled.no_certainty or labelled.provenance.get("simulated"):
        return labelled.no_certainty
    columns = zip(labelled.table.names, labelled.table.values.T, strict=True)
    features = [(name, column.tolist()) for name, column in columns if not np.isnan(column).any()]
    for name, values in (*features, *labelled.recorded_with.items()):
        if says_the_label(values, labelled.labels):
            return (
                f"all trials of a label have the same {name}: which of both is recognised cannot be told. Record each "
                f"label with several; a feature can be left out ({option('features', '-NAME', python='columns')})"
            )
    if labelled.order is None:
        return ""
    in_time = labelled.rows(np.argsort(np.array(labelled.order), kind="stable"))
    sorted_later = f"state the order of a table that was sorted later ({option('order', 'COLUMN')})"
    if (labelled.grouped or exchangeable_instances(labelled) is None) and _in_stretches(in_time.labels):
        return (
            "each label was recorded in one stretch, or nearly: whether it is recognised by its object, or by what "
            "changed from one stretch to the next, as a drift or a mounting, cannot be told. Record the labels in "
            f"turns, name several objects of each ({option('instance', 'COLUMN')}), or {sorted_later}"
        )
    if _drifts(in_time):
        return (
            "the features of all labels follow the time alike, as those of a sensor that drifts: how often later "
            "grasps are recognised cannot be told. Remove the drift, record in several sessions and name them "
            f"({option('instance', 'COLUMN')}), or {sorted_later}"
        )
    return ""


def says_the_label(values: Sequence[Hashable], labels: Sequence[str]) -> bool:
    """Return whether all lines of a label have the same value, which differs, as the label in other words does.

    Where labels share a value, the lines of each must not be few, since values with few choices can agree by chance.
    """
    pairs = set(zip(values, labels, strict=True))
    different, among = len(set(values)), len(set(labels))
    few = different < among and min(Counter(labels).values()) < LEAST_LINES
    return 1 < different <= len(pairs) == among < len(labels) and not few


def _in_stretches(in_time: Sequence[str]) -> bool:
    """Return whether each of these labels, in the order of recording, is one block, or nearly.

    A label counts as in as many equal stretches as 1 over the sum of the squares of their shares (M. O. Hill, Ecology
    54 (1973) 427): a grasp apart from its others hardly makes a second one. A label with one trial shows nothing.
    """
    trials = Counter(in_time)
    squares = dict.fromkeys((label for label, n in trials.items() if n > 1), 0.0)
    for label, stretch in groupby(label for label in in_time if label in squares):
        squares[label] += (len(list(stretch)) / trials[label]) ** 2
    return len(squares) > 1 and sum(1.0 / share for share in squares.values()) <= _IN_TURNS * len(squares)


def _drifts(in_time: Labelled) -> bool:
    """Return whether the features of these trials, in the order of recording, follow the time within all labels alike.

    Trials of a label count in blocks: neighbours may be of one object. Features with few values were set, not measured.
    """
    labels = np.array(in_time.labels)
    parts = [np.array_split(np.flatnonzero(labels == name), _BLOCKS) for name in in_time.classes]
    blocks = [block for of_label in parts for block in of_label if len(block)]
    values = in_time.table.values[np.concatenate(blocks)]
    values = values[:, [len(np.unique(column)) > _BLOCKS for column in values.T]]
    block_of = np.repeat(np.arange(len(blocks)), [len(block) for block in blocks])
    codes = np.unique([labels[block[0]] for block in blocks], return_inverse=True)[1]
    times = np.array([block.mean() for block in blocks])
    drift = beyond_chance(
        means_of(values, block_of), codes, lambda ranks: float(((times @ ranks) ** 2).sum())
    )
    return drift > _DRIFT and not is_sorted(values, codes[block_of])
