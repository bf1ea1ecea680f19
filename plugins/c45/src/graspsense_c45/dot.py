"""The tree for Graphviz."""

from __future__ import annotations

from graspsense_c45.branch_words import branch, label_text
from graspsense_c45.tree import Tree


def to_dot(tree: Tree) -> str:
    """A digraph in the DOT language: inner nodes name their attribute, edges the branch, leaves class and weight."""
    lines = ["digraph c45 {", "  node [shape=box];"]
    for node in range(tree.n_nodes):
        if tree.is_leaf(node):
            label = f"{label_text(tree, int(tree.majority[node]))}\\n{tree.weight[node]:g}"
            lines.append(f'  n{node} [label="{_quoted(label)}", style=rounded];')
            continue
        lines.append(f'  n{node} [label="{_quoted(tree.attribute(node).name)}"];')
        for slot, son in enumerate(tree.sons(node)):
            words = branch(tree, node, slot).removeprefix(tree.attribute(node).name).strip()
            lines.append(f'  n{node} -> n{son} [label="{_quoted(words)}"];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return text.replace("\\n", "\n").replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
