"""A decision tree as a nested list: it reads aloud, prints, and fits a telephone."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Final

from graspsense.report.html import wide

if TYPE_CHECKING:
    from graspsense.core.tree import TreeNode

MOST: Final = 400
"""Nodes drawn; a larger tree is cut, and says so."""


def tree_list(nodes: Sequence[TreeNode]) -> str:
    """Return the tree, from the root on."""
    sons: dict[int | None, list[int]] = {}
    for k, node in enumerate(nodes[:MOST]):
        sons.setdefault(node.parent, []).append(k)

    def item(k: int) -> str:
        node = nodes[k]
        below = sons.get(k, [])
        branch = f"{escape(node.branch)} " if node.branch else ""
        if not below:
            wrong = f", {node.wrong:.3g} of them wrong" if node.wrong else ""
            return (
                f'<li>{branch}→ <span class="leaf">{escape(node.label)}</span> '
                f'<span class="count">({node.trials:.4g} trials{wrong})</span></li>'
            )
        inner = "".join(map(item, below))
        return f"<li>{branch or 'all trials '}<ul>{inner}</ul></li>"

    cut = f"<p>Only the first {MOST} of {len(nodes)} nodes are shown.</p>" if len(nodes) > MOST else ""
    return wide("Decision tree", f'<ul class="tree">{"".join(map(item, sons.get(None, [])))}</ul>') + cut
