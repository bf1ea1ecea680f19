"""Sorting the entries of a node by child."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import Integers, IntegerTable, Numbers, NumberTable
from graspsense_c45.tree import ALL_VALUES


class Entries(NamedTuple):
    """Rows and parts of rows, which are called entries, sorted for each attribute.

    rows, values: attributes x entries, sorted by (node, value); values that are missing are NaN, and last.
    labels, weights: one for each row and part. Parts are numbered from the number of rows on, and a number is used
    again when all nodes at which it was are done.
    """

    rows: IntegerTable
    values: NumberTable
    labels: Integers
    weights: Integers


class Place(NamedTuple):
    """A node and its entries: from `begin` to `stop` of each attribute. The numbers from `free` on are not used."""

    node: int
    begin: int
    stop: int
    free: int


class Split(NamedTuple):
    """How a node is split.

    numeric: whether by a cut. place: of the cut, behind this entry; of a nominal attribute the category. children: from
    `eldest` on.
    """

    attribute: int
    numeric: bool
    place: int
    eldest: int
    n_children: int


class Deal(NamedTuple):
    """How the entries of a node are dealt out, and room for it; everything is written before it is read.

    slots: for each entry its child, counted from 0. Where the value is missing it is -1 if the first child gets a part,
    else the number of children. ordinals: how many entries without a value are before this one.
    known, n_entries, free: of each child, the weight that knows the value, all entries, and the first free number.
    share: for each child, of an entry without the value; 0 where it gets no part. parts: the number of its first part,
    -1 where it gets the entries themselves.
    rows, values: entries that do not go to the first child only. n_missing: how many do not know the value.
    """

    slots: Integers
    ordinals: Integers
    known: Integers
    n_entries: Integers
    free: Integers
    share: Numbers
    parts: Integers
    rows: Integers
    values: Numbers
    n_missing: Integers


def deal_out(place: Place, split: Split, counts: IntegerTable, entries: Entries, deal: Deal) -> bool:
    """Deal out the entries of a node, and count the classes of its children; return whether there is room enough."""
    known_stop = deal_known(place, split, counts, entries, deal)
    deal.n_missing[0] = place.stop - known_stop
    return known_stop == place.stop or deal_missing(place, known_stop, split, counts, entries, deal)


def sort_by_child(place: Place, split: Split, entries: Entries, deal: Deal) -> None:
    """Sort the entries of a node by child for each attribute, after they are dealt out."""
    missing = deal.n_missing[0] > 0
    for a in range(len(entries.rows)):
        # What is sorted by value is sorted by child, but for one value against the others.
        if a != split.attribute or missing or (not split.numeric and split.place != ALL_VALUES):
            move(entries.rows[a], entries.values[a], place, split.n_children, missing, deal)


def deal_known(place: Place, split: Split, counts: IntegerTable, entries: Entries, deal: Deal) -> int:
    """Deal out the entries that know the value; return where those without it begin."""
    rows, values = entries.rows[split.attribute], entries.values[split.attribute]
    for child in range(split.n_children):
        deal.known[child] = deal.n_entries[child] = 0
        deal.free[child] = place.free
    for i in range(place.begin, place.stop):
        value = values[i]
        if value != value:
            return i
        if split.numeric:
            slot = 1 if i > split.place else 0
        elif split.place == ALL_VALUES:
            slot = int(value)
        else:
            slot = 0 if int(value) == split.place else 1
        row = rows[i]
        weight = entries.weights[row]
        deal.slots[row] = slot
        deal.known[slot] += weight
        deal.n_entries[slot] += 1
        counts[split.eldest + slot][entries.labels[row]] += weight
    return place.stop


def deal_missing(
    place: Place, known_stop: int, split: Split, counts: IntegerTable, entries: Entries, deal: Deal
) -> bool:
    """Deal out the entries that do not know the value, in parts; return whether there are enough entries for them."""
    n_missing = place.stop - known_stop
    total, number = 0, split.n_children
    for child in range(number):
        total += deal.known[child]
    free, whole = place.free, -1
    for child in range(number):
        share = share_of(deal.known[child], total, number)
        deal.share[child] = share
        if share > 0.0:
            deal.n_entries[child] += n_missing
            deal.parts[child] = -1 if whole < 0 else free
            free += 0 if whole < 0 else n_missing
            whole = child if whole < 0 else whole
        deal.free[child] = free
    if free > len(entries.weights):
        return False
    rows = entries.rows[split.attribute]
    for i in range(known_stop, place.stop):
        row = rows[i]
        weight, label = entries.weights[row], entries.labels[row]
        deal.slots[row] = -1 if whole == 0 else number
        deal.ordinals[row] = i - known_stop
        for child in range(number):
            if deal.share[child] > 0.0:
                part = part_of(row, deal.ordinals[row], deal.parts[child])
                entries.labels[part] = label
                entries.weights[part] = round(weight * deal.share[child])
                counts[split.eldest + child][label] += entries.weights[part]
    return True


def share_of(known: int, total: int, n_children: int) -> float:
    """Return the share of a child in an entry without the value, from the weights that know it; 0 for no part."""
    share = known / total if total > 0 else 1.0 / n_children
    return share if share > TOLERANCE else 0.0


def part_of(row: int, ordinal: int, parts: int) -> int:
    """Return the number of the part of an entry that a child gets; see `Deal.ordinals` and `Deal.parts`."""
    return row if parts < 0 else parts + ordinal


def move(rows: Integers, values: Numbers, place: Place, n_children: int, missing: bool, deal: Deal) -> None:
    """Sort the entries of a node by child; they keep their order within each."""
    slots, spare_rows, spare_values = deal.slots, deal.rows, deal.values
    # Every entry is written to both arrays, and a counter advances: a branch would often be mispredicted.
    end, n_spare = place.begin, 0
    for i in range(place.begin, place.stop):
        row, value = rows[i], values[i]
        slot = slots[row]
        rows[end], values[end] = row, value
        spare_rows[n_spare], spare_values[n_spare] = row, value
        end += slot <= 0
        n_spare += slot != 0
    if n_children == 2 and not missing:
        for i in range(n_spare):
            rows[end + i] = spare_rows[i]
            values[end + i] = spare_values[i]
        return
    for child in range(1, n_children):
        for i in range(n_spare):
            row = spare_rows[i]
            slot = slots[row]
            if slot == child:
                rows[end], values[end] = row, spare_values[i]
                end += 1
            elif (slot < 0 or slot == n_children) and deal.share[child] > 0.0:
                rows[end] = part_of(row, deal.ordinals[row], deal.parts[child])
                values[end] = spare_values[i]
                end += 1
