"""Growing a tree depth first.

Every attribute keeps the entries of the node, which are rows or parts of rows, in one array, sorted by its value. The
entries of the nodes that are still to be looked at are intervals of it, one behind the other; the node that is looked
at has the last one. A split sorts the entries of a node by child. There may be more of them than before, since a row
whose tested value is missing goes to several children.
"""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arithmetic import TOLERANCE, Scale, first_maximum, real_weight, term
from graspsense_c45.arrays import Integers, IntegerTable, Numbers, Truths
from graspsense_c45.building.cuts import Limits, Run, limits_of, scan_unit, scan_weighted
from graspsense_c45.building.dealing import Deal, Entries, Place, Split, deal_out, sort_by_child
from graspsense_c45.building.nodes import Nodes, weight_of
from graspsense_c45.building.nominal import Values, split_all_values, split_value_off
from graspsense_c45.criteria import (
    choose_attribute,
    gain_of_cut,
    is_pure_or_small,
    least_units,
    midpoint,
    ratio_of_cut,
)


class Rules(NamedTuple):
    """The constants of growing; see `training_set.TrainingSet` and `options.Options`."""

    n_rows: int
    n_classes: int
    min_objects: float
    scale: Scale
    weight_margin: int
    mdl_correction: bool
    by_ratio: bool
    binary_splits: bool
    unit: bool
    complete: bool


class Candidates(NamedTuple):
    """The best split of each attribute at a node.

    place: the cut is behind this entry of the sorted rows; of a nominal attribute, the category. averaged,
    value_counts: see `training_set.TrainingSet`.
    """

    usable: Truths
    gain: Numbers
    ratio: Numbers
    place: Integers
    averaged: Truths
    value_counts: Integers


class Waiting(NamedTuple):
    """Nodes that are to be looked at, and their entries: from `begin` to `stop`; see `dealing.Entries` for `free`."""

    node: Integers
    begin: Integers
    stop: Integers
    free: Integers


class Counted(NamedTuple):
    """Weights by class, written before they are read: on one side of a cut, of known rows, and by nominal value.

    terms: for each class, the sum of L(class) over the sides of a cut.
    """

    passed: Integers
    terms: Integers
    known: Integers
    by_value: IntegerTable


class Terms(NamedTuple):
    """Where all rows weigh 1, ``x ln x`` of 0, 1, ... rows in fixed point, and the differences of these."""

    terms: Integers
    steps: Integers


class SplitSearch(NamedTuple):
    """What the search for the best split of a node works on."""

    candidates: Candidates
    counted: Counted
    terms: Terms


class Growth(NamedTuple):
    """What growing works on."""

    entries: Entries
    search: SplitSearch
    deal: Deal
    waiting: Waiting


def grow(nodes: Nodes, growth: Growth, rules: Rules) -> int:
    """Grow the unpruned tree, whose thresholds are midpoints; return its number of nodes.

    nodes: leaves without weight. Where those or the entries do not suffice, -1 is returned, and all is to be prepared
    again, with more.
    """
    # Most functions get a part of it only: a compiler takes the longer the more arrays are passed.
    entries, search, deal, waiting = growth
    if rules.unit:
        tabulate(search.terms, rules.scale)
    for row in range(rules.n_rows):
        nodes.counts[0][entries.labels[row]] += entries.weights[row]
    waiting.node[0] = waiting.begin[0] = 0
    waiting.stop[0] = waiting.free[0] = rules.n_rows
    n_nodes, n_waiting = 1, 1 if is_open(nodes.counts[0], rules) else 0
    while n_waiting > 0:
        n_waiting -= 1
        place = Place(
            waiting.node[n_waiting],
            waiting.begin[n_waiting],
            waiting.stop[n_waiting],
            waiting.free[n_waiting],
        )
        chosen = best_split(place, nodes.counts[place.node], entries, search, rules)
        if chosen < 0:
            continue
        split = make_split(place.node, chosen, n_nodes, nodes, entries, search.candidates, rules)
        n_nodes += split.n_children
        if n_nodes > len(nodes.feature) or not deal_out(place, split, nodes.counts, entries, deal):
            return -1
        n_open = add_children(n_waiting, place, split, nodes.counts, waiting, deal, rules)
        if n_open > 0:
            sort_by_child(place, split, entries, deal)
        n_waiting += n_open
    return n_nodes


def add_children(
    n_waiting: int,
    place: Place,
    split: Split,
    counts: IntegerTable,
    waiting: Waiting,
    deal: Deal,
    rules: Rules,
) -> int:
    """Add those children of a node that may be split behind the waiting nodes; return their number."""
    begin, n_open = place.begin, 0
    for slot in range(split.n_children):
        stop = begin + deal.n_entries[slot]
        if is_open(counts[split.eldest + slot], rules):
            i = n_waiting + n_open
            waiting.node[i], waiting.free[i] = split.eldest + slot, deal.free[slot]
            waiting.begin[i], waiting.stop[i] = begin, stop
            n_open += 1
        begin = stop
    return n_open


def is_open(counts: Integers, rules: Rules) -> bool:
    """Return whether a node with these counts may be split."""
    weight_bits = rules.scale.weight_bits
    majority = counts[first_maximum(counts, 0, rules.weight_margin)]
    return not is_pure_or_small(
        real_weight(weight_of(counts), weight_bits), real_weight(majority, weight_bits), rules.min_objects
    )


def tabulate(terms: Terms, scale: Scale) -> None:
    """Write the terms of whole numbers of rows, and their differences."""
    for number in range(len(terms.terms)):
        terms.terms[number] = term(number, scale)
    for number in range(len(terms.steps)):
        terms.steps[number] = terms.terms[number + 1] - terms.terms[number]


def best_split(place: Place, counts: Integers, entries: Entries, search: SplitSearch, rules: Rules) -> int:
    """Return the attribute to split an open node on, -1 if it stays a leaf; write the splits to the candidates."""
    scale, candidates = rules.scale, search.candidates
    total = weight_of(counts)
    weight = real_weight(total, scale.weight_bits)
    limits = limits_of(place.stop - place.begin, total, weight, rules.n_classes, rules.min_objects, scale)
    for a in range(len(candidates.gain)):
        candidates.usable[a] = False
        if candidates.value_counts[a] > 0:
            enter_values(a, place, total, entries, search, rules)
        else:
            enter_cut(a, place, counts, limits, entries, search, rules)
    chosen: int = choose_attribute(
        candidates.usable, candidates.gain, candidates.ratio, candidates.averaged, rules.by_ratio
    )
    return chosen


def enter_cut(
    a: int,
    place: Place,
    counts: Integers,
    limits: Limits,
    entries: Entries,
    search: SplitSearch,
    rules: Rules,
) -> None:
    """Enter the best cut of a numeric attribute at a node."""
    candidates, counted, scale = search.candidates, search.counted, rules.scale
    total = weight_of(counts)
    stop, totals, known = place.stop, counts, total
    if not rules.complete:
        stop = count_known(a, place, counts, entries, counted.known)
        if stop < place.stop:
            totals = counted.known
            known = weight_of(totals)
            weight = real_weight(total, scale.weight_bits)
            limits = limits_of(stop - place.begin, known, weight, rules.n_classes, rules.min_objects, scale)
    if not limits.enough:
        return
    run = Run(
        rows=entries.rows[a],
        values=entries.values[a],
        begin=place.begin,
        stop=stop,
        labels=entries.labels,
        counts=totals,
        passed=counted.passed,
    )
    if rules.unit:
        cut = scan_unit(run, search.terms.terms, search.terms.steps, limits)
    else:
        cut = scan_weighted(run, entries.weights, counted.terms, scale, limits)
    if cut.place < 0:
        return
    gain = gain_of_cut(cut.numerator, cut.n_cuts, known, total, scale, rules.mdl_correction)
    candidates.usable[a] = gain >= TOLERANCE
    candidates.gain[a] = gain
    sides = term(cut.left, scale) + term(known - cut.left, scale) + term(total - known, scale)
    candidates.ratio[a] = ratio_of_cut(gain, term(total, scale) - sides, total, scale)
    candidates.place[a] = cut.place


def count_known(a: int, place: Place, counts: Integers, entries: Entries, known: Integers) -> int:
    """Write the weights of the classes that know the value of an attribute; return where those without it begin."""
    rows, values, stop = entries.rows[a], entries.values[a], place.stop
    for k in range(len(counts)):
        known[k] = counts[k]
    while stop > place.begin and values[stop - 1] != values[stop - 1]:
        stop -= 1
        known[entries.labels[rows[stop]]] -= entries.weights[rows[stop]]
    return stop


def enter_values(
    a: int, place: Place, total: int, entries: Entries, search: SplitSearch, rules: Rules
) -> None:
    """Enter the best split of a nominal attribute at a node."""
    candidates, counted = search.candidates, search.counted
    n_values = candidates.value_counts[a]
    for k in range(rules.n_classes):
        counted.known[k] = 0
        for value in range(n_values):
            counted.by_value[value][k] = 0
    for i in range(place.begin, place.stop):
        if entries.values[a][i] != entries.values[a][i]:
            break
        row = entries.rows[a][i]
        counted.by_value[int(entries.values[a][i])][entries.labels[row]] += entries.weights[row]
        counted.known[entries.labels[row]] += entries.weights[row]
    enough = least_units(rules.min_objects, rules.scale.weight_bits)
    values = Values(
        counts=counted.by_value,
        n_values=n_values,
        totals=counted.known,
        weight=total,
        enough=enough,
        scale=rules.scale,
    )
    split = split_value_off(values, rules.by_ratio) if rules.binary_splits else split_all_values(values)
    candidates.usable[a], candidates.gain[a], candidates.ratio[a] = split.usable, split.gain, split.ratio
    candidates.place[a] = split.category


def make_split(
    node: int, chosen: int, eldest: int, nodes: Nodes, entries: Entries, candidates: Candidates, rules: Rules
) -> Split:
    """Split a node by the best split of an attribute; its children are `eldest` and those behind it."""
    place, n_values = candidates.place[chosen], candidates.value_counts[chosen]
    number = 2 if n_values == 0 or rules.binary_splits else n_values
    nodes.feature[node], nodes.first_child[node], nodes.n_children[node] = chosen, eldest, number
    if n_values > 0:
        nodes.category[node] = place
    else:
        values = entries.values[chosen]
        nodes.threshold[node] = midpoint(values[place], values[place + 1])
    return Split(attribute=chosen, numeric=n_values == 0, place=place, eldest=eldest, n_children=number)
