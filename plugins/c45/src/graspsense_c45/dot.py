"""A tree for Graphviz."""

from __future__ import annotations

from graspsense_c45.branch_words import branch, label_text
from graspsense_c45.tree import Tree


def to_dot(tree: Tree) -> str:
    """Return the tree in the DOT language: attributes at nodes, conditions at edges, class and weight at leaves."""
    lines = ["digraph c45 {", "  node [shape=box];"]
    for node in range(tree.node_count):
        if tree.is_leaf(node):
            label = (
                f"{label_text(tree, int(tree.majority_class[node]))}\\n{tree.weighted_n_node_samples[node]:g}"
            )
            lines.append(f'  n{node} [label="{_quoted(label)}", style=rounded];')
            continue
        lines.append(f'  n{node} [label="{_quoted(tree.attribute(node).name)}"];')
        for slot, child in enumerate(tree.children(node)):
            words = branch(tree, node, slot).removeprefix(tree.attribute(node).name).strip()
            lines.append(f'  n{node} -> n{child} [label="{_quoted(words)}"];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return text.replace("\\n", "\n").replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
