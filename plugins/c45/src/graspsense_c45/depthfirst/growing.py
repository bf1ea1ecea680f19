"""Growing a tree depth first.

Every attribute keeps its rows sorted by (node, value) in one array, in which the rows of a node are an interval. A
split partitions the interval in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE, Scale, first_maximum, real_weight, term
from graspsense_c45.arrays import FixedPoint, Indices, Integer, Mask, Reals, SmallLabels
from graspsense_c45.criteria import (
    choose_attribute,
    gain_of_cut,
    gain_tolerance,
    has_enough_rows,
    is_pure_or_small,
    least_numerator,
    least_units,
    midpoint,
    min_side_weight,
    ratio_of_cut,
)
from graspsense_c45.depthfirst.nodes import Nodes, RowIndices, weight_of
from graspsense_c45.depthfirst.scanning import Cut, Limits, Run, scan_unit, scan_weighted


class Columns(NamedTuple):
    """The rows, sorted for every attribute.

    rows, values: attributes x rows, sorted by (node, value). labels, weights: one per row.
    terms: where all rows weigh 1, ``x ln x`` of 0, 1, ... rows in fixed point. steps: their differences.
    """

    rows: RowIndices
    values: Reals
    labels: SmallLabels
    weights: FixedPoint
    terms: FixedPoint
    steps: FixedPoint


class Rules(NamedTuple):
    """The constants of growing; see `training_set.TrainingSet` and `options.Options`."""

    n_classes: int
    min_objects: float
    scale: Scale
    weight_margin: int
    mdl_correction: bool
    by_ratio: bool
    unit: bool


class Candidates(NamedTuple):
    """The best split of each attribute at a node. place: the cut is behind this entry of the sorted rows."""

    usable: Mask
    gain: Reals
    ratio: Reals
    place: Indices
    averaged: Mask


class GrowingSpace(NamedTuple):
    """Arrays that are written before they are read.

    goes_left, rows, values: for the rows of a node. passed: one entry per class. waiting: the nodes to look at.
    """

    goes_left: Mask
    rows: RowIndices
    values: Reals
    passed: FixedPoint
    waiting: Indices


def grow(
    nodes: Nodes, columns: Columns, rules: Rules, candidates: Candidates, workspace: GrowingSpace
) -> Integer:
    """Grow the unpruned tree, whose thresholds are midpoints; return its number of nodes, and sort `columns` by leaf.

    nodes: leaves without rows, twice as many as there are rows, since each leaf of the tree has one or more.

    `nodewise.growing.grow` grows the same tree; `tests/test_engines.py` checks that both agree to the bit.
    """
    n_rows = columns.rows.shape[1]
    for row in range(n_rows):
        nodes.counts[0, columns.labels[row]] += columns.weights[row]
    nodes.end[0] = n_rows
    n_nodes = np.int64(1)
    workspace.waiting[0] = 0
    n_waiting = np.int64(1)
    while n_waiting > 0:
        n_waiting -= 1
        node = workspace.waiting[n_waiting]
        chosen = best_split(node, nodes, columns, rules, candidates, workspace)
        if chosen < 0:
            continue
        split(node, chosen, candidates.place[chosen], n_nodes, nodes, columns, workspace)
        workspace.waiting[n_waiting] = n_nodes + 1
        workspace.waiting[n_waiting + 1] = n_nodes
        n_waiting += 2
        n_nodes += 2
    return n_nodes


def best_split(
    node: Integer,
    nodes: Nodes,
    columns: Columns,
    rules: Rules,
    candidates: Candidates,
    workspace: GrowingSpace,
) -> Integer:
    """Return the attribute to split a node on, -1 if it stays a leaf; write the cuts to `candidates`."""
    counts = nodes.counts[node]
    total = weight_of(counts)
    weight = real_weight(total, rules.scale.weight_bits)
    majority = counts[first_maximum(counts, np.int64(0), rules.weight_margin)]
    if is_pure_or_small(weight, real_weight(majority, rules.scale.weight_bits), rules.min_objects):
        return -1
    begin, stop = nodes.start[node], nodes.end[node]
    least_weight = min_side_weight(weight, rules.n_classes, rules.min_objects)
    if not has_enough_rows(stop - begin, least_weight):
        return -1
    limits = Limits(
        np.int64(least_units(least_weight, rules.scale.weight_bits)),
        np.int64(gain_tolerance(weight, rules.scale.term_bits)),
        np.int64(least_numerator(weight, weight, rules.scale.term_bits)),
    )
    for a in range(len(candidates.gain)):
        run = Run(
            rows=columns.rows[a], values=columns.values[a], labels=columns.labels, begin=begin, stop=stop
        )
        cut = best_cut(run, counts, columns, rules, limits, workspace.passed)
        candidates.usable[a] = False
        if cut.place < 0:
            continue
        gain = gain_of_cut(cut.numerator, cut.n_cuts, total, total, rules.scale, rules.mdl_correction)
        candidates.usable[a] = gain >= TOLERANCE
        candidates.gain[a] = gain
        sides = term(cut.left, rules.scale) + term(total - cut.left, rules.scale)
        split_numerator = term(total, rules.scale) - sides
        candidates.ratio[a] = ratio_of_cut(gain, split_numerator, total, rules.scale)
        candidates.place[a] = cut.place
    chosen: Integer = choose_attribute(
        candidates.usable, candidates.gain, candidates.ratio, candidates.averaged, rules.by_ratio
    )
    return chosen


def best_cut(
    run: Run, counts: FixedPoint, columns: Columns, rules: Rules, limits: Limits, passed: FixedPoint
) -> Cut:
    """Return the best cut of an attribute at a node."""
    for k in range(len(passed)):
        passed[k] = 0
    if rules.unit:
        return scan_unit(run, counts, passed, columns.terms, columns.steps, limits)
    return scan_weighted(run, counts, passed, columns.weights, rules.scale, limits)


def split(
    node: Integer,
    chosen: Integer,
    place: Integer,
    left: Integer,
    nodes: Nodes,
    columns: Columns,
    workspace: GrowingSpace,
) -> None:
    """Split a node on the attribute `chosen` behind the entry `place`; its children become `left` and `left + 1`."""
    begin, stop = nodes.start[node], nodes.end[node]
    nodes.feature[node] = chosen
    nodes.threshold[node] = midpoint(columns.values[chosen, place], columns.values[chosen, place + 1])
    nodes.first_child[node] = left
    for i in range(begin, stop):
        workspace.goes_left[columns.rows[chosen, i]] = i <= place
    for i in range(begin, place + 1):
        row = columns.rows[chosen, i]
        nodes.counts[left, columns.labels[row]] += columns.weights[row]
    for k in range(nodes.counts.shape[1]):
        nodes.counts[left + 1, k] = nodes.counts[node, k] - nodes.counts[left, k]
    for a in range(len(columns.rows)):
        if a != chosen:
            partition(columns.rows[a], columns.values[a], begin, stop, workspace)
    nodes.start[left], nodes.end[left] = begin, place + 1
    nodes.start[left + 1], nodes.end[left + 1] = place + 1, stop


def partition(
    rows: RowIndices, values: Reals, begin: Integer, stop: Integer, workspace: GrowingSpace
) -> None:
    """Move the rows that go left to the front of an interval; both parts keep their order."""
    goes_left, spare_rows, spare_values = workspace.goes_left, workspace.rows, workspace.values
    # Every row is written to both arrays, and one counter advances: a branch would often be mispredicted.
    place = begin
    kept: Integer = 0
    for i in range(begin, stop):
        row, value = rows[i], values[i]
        left = np.int64(goes_left[row])
        rows[place], values[place] = row, value
        spare_rows[kept], spare_values[kept] = row, value
        place += left
        kept += 1 - left
    for i in range(kept):
        rows[place + i] = spare_rows[i]
        values[place + i] = spare_values[i]
