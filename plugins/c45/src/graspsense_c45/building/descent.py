"""Rows on their way down a tree, along one path at a time.

The rows of the nodes on the path, or their parts, lie one node behind the other. A node is entered from its parent, and
its rows are given up when it is left.
"""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arrays import Integers, NumberTable, Truths
from graspsense_c45.building.dealing import share_of
from graspsense_c45.building.nodes import Nodes
from graspsense_c45.tree import ALL_VALUES


class Rows(NamedTuple):
    """Rows with values (rows x attributes), labels and fixed-point weights; complete: whether no value is missing."""

    values: NumberTable
    labels: Integers
    weights: Integers
    complete: bool


class Descent(NamedTuple):
    """A path, and the rows of the nodes on it.

    path: the nodes; length: their number. entered: for each node on the path, how many of its children were entered.
    begin, stop: of its entries.
    rows, weights: the entries. lacking: whether they did not suffice; nothing that comes out then is right.
    known: for each node the weight of those rows of its parent that know the value and come to it, in proportion to
    which the others are distributed; given: whether it holds numbers to be used instead.
    """

    path: Integers
    length: Integers
    entered: Integers
    begin: Integers
    stop: Integers
    rows: Integers
    weights: Integers
    lacking: Truths
    known: Integers
    given: bool


def start_at_root(rows: Rows, descent: Descent) -> None:
    """Begin with all rows at the root."""
    for row in range(len(rows.weights)):
        descent.rows[row] = row
        descent.weights[row] = rows.weights[row]
    descent.length[0] = 1
    descent.path[0] = descent.entered[0] = descent.begin[0] = 0
    descent.stop[0] = len(rows.weights)


def last_on_path(descent: Descent) -> int:
    """Return the node at the end of the path."""
    return int(descent.path[descent.length[0] - 1])


def add_to_path(node: int, descent: Descent) -> None:
    """Put a node at the end of the path, none of whose children was entered."""
    descent.path[descent.length[0]], descent.entered[node] = node, 0
    descent.length[0] += 1


def enter_child(node: int, moves: bool, nodes: Nodes, rows: Rows, descent: Descent) -> int:
    """Put the next child of the node at the end of the path behind it, and return it; moves: with its rows."""
    child = nodes.first_child[node] + descent.entered[node]
    if moves:
        if not (descent.entered[node] or rows.complete or descent.given):
            weigh_known(node, nodes, rows, descent)
        move_rows(node, child, nodes, rows, descent)
    descent.entered[node] += 1
    add_to_path(child, descent)
    return int(child)


def weigh_known(node: int, nodes: Nodes, rows: Rows, descent: Descent) -> None:
    """Write, for each child of a node, the weight of the rows that know the value and come to it."""
    feature, eldest = nodes.feature[node], nodes.first_child[node]
    threshold, category = nodes.threshold[node], nodes.category[node]
    for child in range(eldest, eldest + nodes.n_children[node]):
        descent.known[child] = 0
    for i in range(descent.begin[node], descent.stop[node]):
        value = rows.values[descent.rows[i]][feature]
        if value == value:
            descent.known[eldest + slot_of(value, threshold, category)] += descent.weights[i]


def move_rows(node: int, child: int, nodes: Nodes, rows: Rows, descent: Descent) -> None:
    """Write the rows of a node that come to a child behind those of the node."""
    feature, eldest, number = nodes.feature[node], nodes.first_child[node], nodes.n_children[node]
    threshold, category = nodes.threshold[node], nodes.category[node]
    begin, stop = descent.begin[node], descent.stop[node]
    descent.begin[child] = descent.stop[child] = stop
    if not has_room(node, descent):
        return
    share = 0.0
    if not rows.complete:
        total = 0
        for other in range(eldest, eldest + number):
            total += descent.known[other]
        share = share_of(descent.known[child], total, number)
    end = stop
    for i in range(begin, stop):
        row, weight = descent.rows[i], descent.weights[i]
        value = rows.values[row][feature]
        if value != value:
            if share > 0.0:
                descent.rows[end], descent.weights[end] = row, round(weight * share)
                end += 1
        else:
            # Written in any case: a branch would often be mispredicted.
            descent.rows[end], descent.weights[end] = row, weight
            end += eldest + slot_of(value, threshold, category) == child
    descent.stop[child] = end


def move_others(node: int, child: int, nodes: Nodes, rows: Rows, descent: Descent) -> None:
    """Write the rows of a node that do not come to a child behind those of the node; no value is missing."""
    feature, eldest = nodes.feature[node], nodes.first_child[node]
    threshold, category = nodes.threshold[node], nodes.category[node]
    begin, stop = descent.begin[node], descent.stop[node]
    descent.begin[child] = end = stop
    if has_room(node, descent):
        for i in range(begin, stop):
            row = descent.rows[i]
            descent.rows[end], descent.weights[end] = row, descent.weights[i]
            end += eldest + slot_of(rows.values[row][feature], threshold, category) != child
    descent.stop[child] = end


def has_room(node: int, descent: Descent) -> bool:
    """Return whether all entries of a node fit behind them; if not, note it."""
    begin, stop = descent.begin[node], descent.stop[node]
    descent.lacking[0] |= stop + stop - begin > len(descent.rows)
    return not descent.lacking[0]


def slot_of(value: float, threshold: float, category: int) -> int:
    """Return the child that a value goes to, counted from 0; see `tree.Splits`."""
    if threshold == threshold:
        return 1 if value > threshold else 0
    if category == ALL_VALUES:
        return int(value)
    return 0 if int(value) == category else 1


def count_classes(node: int, counts: Integers, rows: Rows, descent: Descent) -> None:
    """Write the weight of each class among the rows of a node on the path."""
    for k in range(len(counts)):
        counts[k] = 0
    for i in range(descent.begin[node], descent.stop[node]):
        counts[rows.labels[descent.rows[i]]] += descent.weights[i]
