"""The information-gain preset has no answer from J48: here it is compared with a tree grown by brute force.

The brute force follows the rules one row and one cut at a time in plain Python floats, with none of the package's code.
"""

from __future__ import annotations

from math import log2
from typing import Any

import numpy as np
from cases import every_case

from graspsense_c45 import PAPER, Attribute, Options, Schema, fit, make_table

EPSILON = 1e-6


def entropy(counts):
    total = sum(counts)
    return -sum(c / total * log2(c / total) for c in counts if c)


def count(labels, n_classes):
    return [labels.count(k) for k in range(n_classes)]


def best_cut(pairs, n_classes, min_objects, mdl):
    """Gain and midpoint of the best cut of one column."""
    pairs = sorted(pairs)
    n = len(pairs)
    least = 0.1 * n / n_classes
    least = min_objects if least <= min_objects else min(least, 25)
    whole = entropy(count([k for _, k in pairs], n_classes))
    best, place, number = 0.0, None, 0
    for i in range(1, n):
        if not pairs[i - 1][0] + 1e-5 < pairs[i][0] or i < least - EPSILON or n - i < least - EPSILON:
            continue
        number += 1
        left, right = ([k for _, k in part] for part in (pairs[:i], pairs[i:]))
        gain = whole - sum(len(side) / n * entropy(count(side, n_classes)) for side in (left, right))
        if gain > best + EPSILON:
            best, place = gain, i
    if place is None:
        return None
    if mdl:
        best -= log2(number) / n
    return (best, (pairs[place - 1][0] + pairs[place][0]) / 2) if best >= EPSILON else None


def grow(rows, every, options, n_classes):
    labels = [k for _, k in rows]
    counts = count(labels, n_classes)
    node: dict[str, Any] = {"class_weights": counts}
    if len(rows) < 2 * options.min_objects or max(counts) == len(rows):
        return node
    best, chosen = 0.0, None
    for a in range(len(every[0])):
        pairs = [(x[a], k) for x, k in rows]
        cut = best_cut(pairs, n_classes, int(options.min_objects), options.mdl_correction)
        if cut is not None and cut[0] > best + EPSILON:
            best, chosen = cut[0], (a, cut[1])
    if chosen is None:
        return node
    a, middle = chosen
    threshold = max(x[a] for x in every if x[a] <= middle)
    sides = [[r for r in rows if (r[0][a] <= threshold) == left] for left in (True, False)]
    children = [grow(side, every, options, n_classes) for side in sides]
    return node | {"feature": a, "threshold": threshold, "children": children}


def prune(node, held):
    """Reduced-error pruning in place; returns the held-out errors of what is left."""
    label = node["class_weights"].index(max(node["class_weights"]))
    as_leaf = sum(k != label for _, k in held)
    if "feature" not in node:
        return as_leaf
    a, threshold = node["feature"], node["threshold"]
    as_tree = sum(
        prune(child, [r for r in held if (r[0][a] <= threshold) == left])
        for child, left in zip(node["children"], (True, False), strict=True)
    )
    if as_leaf <= as_tree:
        for key in ("feature", "threshold", "children"):
            del node[key]
        return as_leaf
    return as_tree


def shape(node):
    kept = {"class_weights": [int(c) for c in node["class_weights"]]}
    if "feature" in node:
        kept |= {key: node[key] for key in ("feature", "threshold")}
        kept["children"] = [shape(child) for child in node["children"]]
    return kept


def table(seed):
    rng = np.random.default_rng(seed)
    n, n_classes = int(rng.integers(6, 140)), int(rng.integers(2, 5))
    labels = rng.integers(0, n_classes, n)
    values = np.round(
        labels[:, None] * rng.uniform(0, 1.5, 3) + rng.normal(0, 1, (n, 3)), int(rng.integers(0, 4))
    )
    schema = Schema(tuple(Attribute(f"x{i}") for i in range(3)), tuple(range(n_classes)))
    return make_table(schema, values, labels)


def as_rows(given, rows):
    return [(given.values[i].tolist(), int(given.labels[i])) for i in rows]


@every_case("seed", range(20))
def test_tree_is_the_brute_force_one(seed):
    given = table(seed)
    mdl = bool(seed % 2)
    options = Options(
        criterion="info_gain", pruning="none", collapse=False, mdl_correction=mdl, min_objects=1 + seed % 4
    )
    every = given.values.tolist()
    expected = grow(as_rows(given, list(range(len(every)))), every, options, len(given.schema.classes))
    assert shape(fit(given, options).to_dict()) == shape(expected)


@every_case("seed", range(100, 115))
def test_paper_preset_prunes_on_the_held_out_rows(seed):
    given = table(seed)
    n = len(given.labels)
    held = sorted(np.random.default_rng(seed).choice(n, n // 3, replace=False).tolist())
    kept = [i for i in range(n) if i not in held]
    expected = grow(as_rows(given, kept), given.values.tolist(), PAPER, len(given.schema.classes))
    prune(expected, as_rows(given, held))
    assert shape(fit(given, PAPER, np.array(held)).to_dict()) == shape(expected)
