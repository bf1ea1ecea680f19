"""The compiled engine: the same tree as the level-wise one, grown and pruned depth first (needs the extra ``fast``).

For complete numeric data. The laws are not written again: the elementwise functions of ``arithmetic``, ``criteria`` and
``estimates`` are compiled as they stand. Every attribute keeps its rows sorted by (node, value) in one array, a node's
rows being one interval of it; a split partitions the interval in place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from graspsense_c45 import arithmetic, criteria, estimates
from graspsense_c45.arithmetic import TOLERANCE, Array, bits_below
from graspsense_c45.branches import ALL_VALUES, LEAF, Branches, Tests
from graspsense_c45.problem import WEIGHT_BITS, Problem

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _compile(function: _Function) -> _Function:
    return cast(_Function, numba.njit(cache=True, error_model="numpy", nogil=True)(function))


Number = Any
"""A number of the type the compiler finds."""

for _law in (
    arithmetic.ln_of_parts,
    arithmetic.one_minus_exp,
    criteria.is_pure_or_small,
    criteria.min_side_weight,
    criteria.has_enough_rows,
    criteria.gain,
    criteria.gain_tolerance,
    criteria.least_numerator,
    criteria.least_units,
    criteria.mdl_cost,
    criteria.gain_ratio,
    estimates.estimated_errors,
):
    register_jitable(error_model="numpy")(_law)


@overload(arithmetic.select)
def _select(condition: Any, where_true: Any, where_false: Any) -> Any:
    def one_of_two(condition: Any, where_true: Any, where_false: Any) -> Any:
        return where_true if condition else where_false

    return one_of_two


class Laws(NamedTuple):
    """The numbers that growing needs."""

    n_classes: int
    min_objects: float
    weight_bits: int
    term_bits: int
    weight_margin: int
    mdl_correction: bool
    by_ratio: bool
    unit: bool


class Intervals(NamedTuple):
    """Rows by leaf, and for every node the interval of them that is its own."""

    rows: NDArray[np.uint32]
    start: NDArray[np.int64]
    end: NDArray[np.int64]


def takes(problem: Problem) -> bool:
    """Whether this engine can grow the tree: numeric attributes, nothing missing."""
    return problem.complete and not problem.value_counts.any()


def grow(problem: Problem) -> tuple[Branches, Intervals]:
    """The unpruned tree (thresholds are midpoints) and where its rows are."""
    n_rows, n_attributes = problem.values.shape
    # Unsigned, so that no index is checked for counting from the end.
    order = np.empty((n_attributes, n_rows), dtype=np.uint32)
    values = np.empty((n_attributes, n_rows))
    for a in range(n_attributes):
        column = np.ascontiguousarray(problem.values[:, a])
        order[a] = np.argsort(column)
        values[a] = column[order[a]]
    terms = problem.terms(np.arange(n_rows + 1)) if problem.unit else np.zeros(1, dtype=np.int64)
    options = problem.options
    laws = Laws(
        problem.n_classes,
        float(options.min_objects),
        problem.weight_bits,
        problem.term_bits,
        problem.weight_margin,
        options.mdl_correction,
        options.criterion == "gain_ratio",
        problem.unit,
    )
    attribute, threshold, first_son, counts, start, end = _grow(
        order, values, _small_labels(problem), problem.weights, terms, laws
    )
    n_nodes = len(attribute)
    branches = Branches(
        attribute=attribute,
        threshold=threshold,
        value=np.full(n_nodes, ALL_VALUES, dtype=np.int32),
        first_son=first_son,
        n_sons=np.where(attribute == LEAF, 0, 2).astype(np.int32),
        counts=counts,
    )
    return branches, Intervals(order[0].copy(), start, end)


def collapse(branches: Branches, problem: Problem) -> None:
    """As ``prune.collapse``."""
    slack = np.ldexp(criteria.COLLAPSE_SLACK, problem.weight_bits)
    tree = (branches.attribute, branches.threshold, branches.first_son, branches.counts)
    _collapse(tree, problem.weight_margin, slack)
    branches.n_sons[branches.attribute == LEAF] = 0


def prune_pessimistic(branches: Branches, problem: Problem, intervals: Intervals) -> None:
    """As ``prune.prune_pessimistic``."""
    confidence = estimates.prepare_confidence(problem.options.confidence_factor)
    bits = bits_below(2.0 * float(problem.real_weights(problem.weights.sum())), WEIGHT_BITS)
    limit = int(np.ceil(np.ldexp(criteria.PRUNING_SLACK + TOLERANCE, bits)))
    estimate = (confidence, bits, problem.weight_bits, problem.weight_margin)
    tree = (branches.attribute, branches.threshold, branches.first_son, branches.counts)
    rows = (intervals.rows, intervals.start, intervals.end)
    data = (np.ascontiguousarray(problem.values), _small_labels(problem), problem.weights)
    _prune(tree, rows, data, estimate, limit, problem.options.subtree_raising)
    branches.n_sons[branches.attribute == LEAF] = 0


def reach(tests: Tests, values: NDArray[np.float64]) -> NDArray[np.int64]:
    """The leaf each row comes to from the root; a tree of numeric tests, no value that is tested may be missing."""
    return np.asarray(_reach(tests.attribute, tests.threshold, tests.first_son, np.ascontiguousarray(values)))


def _small_labels(problem: Problem) -> Array:
    return problem.labels.astype(np.min_scalar_type(problem.n_classes))


@_compile
def _term(units: Number, weight_bits: Number, term_bits: Number) -> Number:
    x = math.ldexp(float(units), -weight_bits)
    if x < TOLERANCE:
        return np.int64(0)
    mantissa, exponent = math.frexp(x)
    return np.int64(np.rint(math.ldexp(x * arithmetic.ln_of_parts(mantissa, exponent), term_bits)))


@_compile
def _majority(counts: Array, margin: Number) -> Number:
    best, chosen = np.int64(0), 0
    for k in range(len(counts)):
        if counts[k] - best > margin:
            best, chosen = counts[k], k
    return chosen


@_compile
def _scan_ones(
    columns: Any,
    begin: Number,
    stop: Number,
    counts: Array,
    running: Array,
    terms: Array,
    steps: Array,
    least: Number,
    tolerance: Number,
    zero: Number,
) -> Any:
    """The best cut of an attribute at a node where every row weighs 1: numerator, place (-1: none), left, cuts."""
    rows, values, labels = columns
    total = stop - begin
    # The numerator but for the sides' terms: L(T), and what the rows passed so far changed.
    inside = terms[total]
    best, cut_left, n_cuts = np.int64(0), np.int64(0), 0
    cut: Number = np.int64(-1)
    # Every row weighs 1: there is no cut in the last rows that one side needs.
    for i in range(begin, stop - least):
        k = labels[rows[i]]
        had = running[k]
        running[k] = had + 1
        inside += steps[had] - steps[counts[k] - had - 1]
        left = i + 1 - begin
        if left < least or not values[i] + criteria.GAP < values[i + 1]:
            continue
        n_cuts += 1
        numerator = inside - terms[left] - terms[total - left]
        if numerator - best > tolerance and numerator >= zero:
            best, cut, cut_left = numerator, i, left
    return best, cut, cut_left, n_cuts


@_compile
def _scan_weights(
    columns: Any,
    begin: Number,
    stop: Number,
    counts: Array,
    running: Array,
    weights: Array,
    laws: Laws,
    least: Number,
    tolerance: Number,
    zero: Number,
) -> Any:
    """As ``_scan_ones``, for rows of any weight."""
    rows, values, labels = columns
    total = counts.sum()
    inside = _term(total, laws.weight_bits, laws.term_bits)
    best, cut_left, n_cuts = np.int64(0), np.int64(0), 0
    cut: Number = np.int64(-1)
    left = np.int64(0)
    for i in range(begin, stop - 1):
        row = rows[i]
        k, w = labels[row], weights[row]
        had = running[k]
        rest = counts[k] - had
        running[k] = had + w
        left += w
        right = total - left
        inside += (
            _term(had + w, laws.weight_bits, laws.term_bits)
            - _term(had, laws.weight_bits, laws.term_bits)
            + _term(rest - w, laws.weight_bits, laws.term_bits)
            - _term(rest, laws.weight_bits, laws.term_bits)
        )
        if left < least or right < least or not values[i] + criteria.GAP < values[i + 1]:
            continue
        n_cuts += 1
        numerator = (
            inside
            - _term(left, laws.weight_bits, laws.term_bits)
            - _term(right, laws.weight_bits, laws.term_bits)
        )
        if numerator - best > tolerance and numerator >= zero:
            best, cut, cut_left = numerator, i, left
    return best, cut, cut_left, n_cuts


@_compile
def _grow(order: Array, values: Array, labels: Array, weights: Array, terms: Array, laws: Laws) -> Any:
    n_attributes, n_rows = order.shape
    n_classes = laws.n_classes
    capacity = 256
    attribute = np.full(capacity, LEAF, dtype=np.int32)
    threshold = np.full(capacity, np.nan)
    first_son = np.zeros(capacity, dtype=np.int32)
    counts = np.zeros((capacity, n_classes), dtype=np.int64)
    start = np.zeros(capacity, dtype=np.int64)
    end = np.zeros(capacity, dtype=np.int64)
    for i in range(n_rows):
        counts[0, labels[i]] += weights[i]
    end[0] = n_rows
    n_nodes = 1
    goes_left = np.zeros(n_rows, dtype=np.bool_)
    spare_rows = np.empty(n_rows, dtype=np.uint32)
    spare_values = np.empty(n_rows)
    running = np.zeros(n_classes, dtype=np.int64)
    gains = np.zeros(n_attributes)
    ratios = np.zeros(n_attributes)
    usable = np.zeros(n_attributes, dtype=np.bool_)
    steps = np.diff(terms)
    cuts = np.zeros(n_attributes, dtype=np.int64)
    stack = [np.int64(0)]
    while len(stack) > 0:
        node = stack.pop()
        total = counts[node].sum()
        weight = math.ldexp(float(total), -laws.weight_bits)
        heaviest = math.ldexp(
            float(counts[node, _majority(counts[node], laws.weight_margin)]), -laws.weight_bits
        )
        if criteria.is_pure_or_small(weight, heaviest, laws.min_objects):
            continue
        begin, stop = start[node], end[node]
        least_weight = criteria.min_side_weight(weight, n_classes, laws.min_objects)
        least = np.int64(criteria.least_units(least_weight, laws.weight_bits))
        tolerance = np.int64(criteria.gain_tolerance(weight, laws.term_bits))
        zero = np.int64(criteria.least_numerator(weight, weight, laws.term_bits))
        enough = criteria.has_enough_rows(stop - begin, least_weight)
        for a in range(n_attributes):
            usable[a] = False
            if not enough:
                continue
            running[:] = 0
            columns = (order[a], values[a], labels)
            if laws.unit:
                best, cut, cut_left, n_cuts = _scan_ones(
                    columns, begin, stop, counts[node], running, terms, steps, least, tolerance, zero
                )
            else:
                best, cut, cut_left, n_cuts = _scan_weights(
                    columns, begin, stop, counts[node], running, weights, laws, least, tolerance, zero
                )
            if cut < 0:
                continue
            gain = criteria.gain(math.ldexp(float(best), -laws.term_bits), weight, weight)
            if laws.mdl_correction:
                mantissa, exponent = math.frexp(float(n_cuts))
                gain = gain - criteria.mdl_cost(arithmetic.ln_of_parts(mantissa, exponent), weight)
            split = (
                _term(total, laws.weight_bits, laws.term_bits)
                - _term(cut_left, laws.weight_bits, laws.term_bits)
                - _term(total - cut_left, laws.weight_bits, laws.term_bits)
            )
            usable[a] = gain >= TOLERANCE
            gains[a] = gain
            ratios[a] = criteria.gain_ratio(gain, math.ldexp(float(split), -laws.term_bits), weight)
            cuts[a] = cut
        chosen = _choose(usable, gains, ratios, laws.by_ratio)
        if chosen < 0:
            continue
        if n_nodes + 2 > capacity:
            capacity *= 2
            attribute = _longer(attribute, capacity, LEAF)
            threshold = _longer(threshold, capacity, np.nan)
            first_son = _longer(first_son, capacity, 0)
            start = _longer(start, capacity, 0)
            end = _longer(end, capacity, 0)
            more = np.zeros((capacity, n_classes), dtype=np.int64)
            more[:n_nodes] = counts[:n_nodes]
            counts = more
        cut = cuts[chosen]
        attribute[node] = chosen
        threshold[node] = _midpoint(values[chosen, cut], values[chosen, cut + 1])
        first_son[node] = n_nodes
        for i in range(begin, stop):
            goes_left[order[chosen, i]] = i <= cut
        for i in range(begin, cut + 1):
            row = order[chosen, i]
            counts[n_nodes, labels[row]] += weights[row]
        for k in range(n_classes):
            counts[n_nodes + 1, k] = counts[node, k] - counts[n_nodes, k]
        for a in range(n_attributes):
            if a != chosen:
                _partition(order[a], values[a], begin, stop, goes_left, spare_rows, spare_values)
        start[n_nodes], end[n_nodes] = begin, cut + 1
        start[n_nodes + 1], end[n_nodes + 1] = cut + 1, stop
        stack.append(np.int64(n_nodes + 1))
        stack.append(np.int64(n_nodes))
        n_nodes += 2
    return (
        attribute[:n_nodes].copy(),
        threshold[:n_nodes].copy(),
        first_son[:n_nodes].copy(),
        counts[:n_nodes].copy(),
        start[:n_nodes].copy(),
        end[:n_nodes].copy(),
    )


@_compile
def _longer(array: Array, length: Number, fill: Any) -> Array:
    result = np.full(length, fill, dtype=array.dtype)
    result[: len(array)] = array
    return result


@_compile
def _midpoint(low: Number, high: Number) -> Number:
    middle = (low + high) / 2.0
    if not np.isfinite(middle):
        middle = low / 2.0 + high / 2.0
    return low if middle == high else middle


@_compile
def _choose(usable: Array, gains: Array, ratios: Array, by_ratio: bool) -> Number:
    average = -np.inf
    if by_ratio:
        total, number = 0.0, 0.0
        for a in range(len(usable)):
            if usable[a]:
                total += gains[a]
                number += 1.0
        average = total / max(number, 1.0)
    best, chosen = 0.0, -1
    for a in range(len(usable)):
        score = ratios[a] if by_ratio else gains[a]
        if usable[a] and gains[a] >= average - criteria.AVERAGE_SLACK and score - best > TOLERANCE:
            best, chosen = score, a
    return chosen


@_compile
def _partition(
    rows: Array,
    values: Array,
    begin: Number,
    stop: Number,
    goes_left: Array,
    spare_rows: Array,
    spare_values: Array,
) -> None:
    """Move the rows that go left to the front, both parts keeping their order."""
    # Written to both places and counted in one: a branch on where a row goes would often be guessed wrong.
    at: Number = begin
    kept: Number = 0
    for i in range(begin, stop):
        row, value = rows[i], values[i]
        left = np.int64(goes_left[row])
        rows[at], values[at] = row, value
        spare_rows[kept], spare_values[kept] = row, value
        at += left
        kept += 1 - left
    rows[at:stop] = spare_rows[:kept]
    values[at:stop] = spare_values[:kept]


@_compile
def _estimate(counts: Array, estimate: Any) -> Number:
    confidence, bits, weight_bits, margin = estimate
    total = counts.sum()
    errors = total - counts[_majority(counts, margin)]
    expected = estimates.estimated_errors(
        math.ldexp(float(total), -weight_bits),
        math.ldexp(float(errors), -weight_bits),
        confidence[0],
        confidence[1],
        confidence[2],
    )
    return np.int64(np.rint(math.ldexp(expected, bits)))


@_compile
def _below(tree: Any, root: Number) -> Array:
    """The nodes below a root, itself first, every parent before its sons."""
    attribute, _, first_son, _ = tree
    found = [np.int64(root)]
    stack = [np.int64(root)]
    while len(stack) > 0:
        node = stack.pop()
        if attribute[node] != LEAF:
            son = np.int64(first_son[node])
            found.append(son)
            found.append(son + 1)
            stack.append(son + 1)
            stack.append(son)
    return np.array(found)


@_compile
def _leaf_below(tree: Any, node: Number, values: Array, row: Number) -> Number:
    attribute, threshold, first_son, _ = tree
    while attribute[node] != LEAF:
        node = first_son[node] + (values[row, attribute[node]] > threshold[node])
    return node


@_compile
def _collapse(tree: Any, margin: Number, slack: Number) -> None:
    attribute, _, first_son, counts = tree
    # Every node is grown before its sons; those whose parent is cut are no longer reached, whatever becomes of them.
    errors = np.zeros(len(attribute), dtype=np.int64)
    for node in range(len(attribute) - 1, -1, -1):
        as_leaf = counts[node].sum() - counts[node, _majority(counts[node], margin)]
        errors[node] = as_leaf
        if attribute[node] != LEAF:
            left = first_son[node]
            errors[node] = errors[left] + errors[left + 1]
            if errors[node] >= as_leaf - slack:
                _make_leaf(node, tree)


@_compile
def _prune(tree: Any, rows: Any, data: Any, estimate: Any, limit: Number, raising: bool) -> None:
    attribute, _, _, counts = tree
    n_nodes = len(attribute)
    as_leaf = np.zeros(n_nodes, dtype=np.int64)
    as_tree = np.zeros(n_nodes, dtype=np.int64)
    # What joins each leaf, by class, and in the last column in all.
    joining = np.zeros((n_nodes, counts.shape[1] + 1), dtype=np.int64)
    nodes = _below(tree, 0)
    for node in nodes:
        as_leaf[node] = _estimate(counts[node], estimate)
    for i in range(len(nodes) - 1, -1, -1):
        _prune_at(nodes[i], tree, rows, data, estimate, limit, raising, as_leaf, as_tree, joining)


@_compile
def _prune_at(
    node: Number,
    tree: Any,
    rows: Any,
    data: Any,
    estimate: Any,
    limit: Number,
    raising: bool,
    as_leaf: Array,
    as_tree: Array,
    joining: Array,
) -> None:
    """Prune a node whose sons are pruned; where its heaviest son is raised, everything below it again."""
    attribute, threshold, first_son, counts = tree
    while True:
        as_tree[node] = as_leaf[node]
        if attribute[node] == LEAF:
            return
        left = np.int64(first_son[node])
        as_tree[node] = as_tree[left] + as_tree[left + 1]
        leaf_is_best = as_leaf[node] - as_tree[node] < limit
        if not raising:
            if leaf_is_best:
                _make_leaf(node, tree)
                as_tree[node] = as_leaf[node]
            return
        weight_bits = estimate[2]
        left_weight = math.ldexp(float(counts[left].sum()), -weight_bits)
        right_weight = math.ldexp(float(counts[left + 1].sum()), -weight_bits)
        heavy = left + 1 if left_weight - right_weight < TOLERANCE else left
        as_branch = as_tree[heavy] + _growth(node, heavy, tree, rows, data, estimate, as_leaf, joining)
        if leaf_is_best and as_leaf[node] - as_branch < limit:
            _make_leaf(node, tree)
            as_tree[node] = as_leaf[node]
            return
        if as_branch - as_tree[node] >= limit:
            return
        attribute[node], threshold[node], first_son[node] = (
            attribute[heavy],
            threshold[heavy],
            first_son[heavy],
        )
        nodes = _below(tree, node)
        _resettle(nodes, tree, rows, data)
        for below in nodes:
            as_leaf[below] = _estimate(counts[below], estimate)
        for i in range(len(nodes) - 1, 0, -1):
            _prune_at(nodes[i], tree, rows, data, estimate, limit, raising, as_leaf, as_tree, joining)


@_compile
def _make_leaf(node: Number, tree: Any) -> None:
    attribute, threshold, first_son, _ = tree
    attribute[node], threshold[node], first_son[node] = LEAF, np.nan, 0


@_compile
def _growth(
    node: Number,
    heavy: Number,
    tree: Any,
    rows: Any,
    data: Any,
    estimate: Any,
    as_leaf: Array,
    joining: Array,
) -> Number:
    """By how much the estimates of the heaviest son's leaves grow when the node's other rows join them."""
    order, start, end = rows
    values, labels, weights = data
    counts = tree[3]
    touched = [np.int64(0) for _ in range(0)]
    for part in range(2):
        begin = start[node] if part == 0 else end[heavy]
        stop = start[heavy] if part == 0 else end[node]
        for i in range(begin, stop):
            row = order[i]
            leaf = np.int64(_leaf_below(tree, heavy, values, row))
            # A leaf is noted when its first weight comes; a row of no weight changes nothing.
            if weights[row] > 0:
                if joining[leaf, -1] == 0:
                    touched.append(leaf)
                joining[leaf, -1] += weights[row]
                joining[leaf, labels[row]] += weights[row]
    growth = np.int64(0)
    for leaf in touched:
        growth += _estimate(counts[leaf] + joining[leaf, :-1], estimate) - as_leaf[leaf]
        joining[leaf, :] = 0
    return growth


@_compile
def _resettle(nodes: Array, tree: Any, rows: Any, data: Any) -> None:
    """Send the rows of the first of these nodes down again; sets intervals and counts of all of them."""
    attribute, _, first_son, counts = tree
    order, start, end = rows
    values, labels, weights = data
    root = nodes[0]
    begin, stop = start[root], end[root]
    own = order[begin:stop].copy()
    leaf_of = np.empty(len(own), dtype=np.int64)
    for node in nodes:
        end[node] = 0
        counts[node, :] = 0
    for i in range(len(own)):
        leaf = _leaf_below(tree, root, values, own[i])
        leaf_of[i] = leaf
        end[leaf] += 1
        counts[leaf, labels[own[i]]] += weights[own[i]]
    for i in range(len(nodes) - 1, -1, -1):
        node = nodes[i]
        if attribute[node] != LEAF:
            left = first_son[node]
            end[node] = end[left] + end[left + 1]
            counts[node] = counts[left] + counts[left + 1]
    start[root], end[root] = begin, stop
    for node in nodes:
        if attribute[node] != LEAF:
            left = first_son[node]
            start[left] = start[node]
            end[left] += start[left]
            start[left + 1] = end[left]
            end[left + 1] += start[left + 1]
    for node in nodes:
        if attribute[node] == LEAF:
            end[node] = start[node]
    for i in range(len(own)):
        leaf = leaf_of[i]
        order[end[leaf]] = own[i]
        end[leaf] += 1


@_compile
def _reach(attribute: Array, threshold: Array, first_son: Array, values: Array) -> Array:
    result = np.empty(len(values), dtype=np.int64)
    for row in range(len(values)):
        node = np.int64(0)
        while attribute[node] != LEAF:
            node = first_son[node] + (values[row, attribute[node]] > threshold[node])
        result[row] = node
    return result
