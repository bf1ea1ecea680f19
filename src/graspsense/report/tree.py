"""A decision tree as a nested HTML list, which screen readers, printers and narrow screens can show."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from graspsense.core.values.reasons import TreeNode
from graspsense.report.html import wide

MOST: Final = 400
"""Largest number of nodes that are shown; the page says so if a tree has more."""


def tree_list(nodes: Sequence[TreeNode]) -> str:
    """Return the tree, from the root on."""
    children: dict[int | None, list[int]] = {}
    for k, node in enumerate(nodes[:MOST]):
        children.setdefault(node.parent, []).append(k)

    def item(k: int) -> str:
        node = nodes[k]
        below = children.get(k, [])
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
    return wide("Decision tree", f'<ul class="tree">{"".join(map(item, children.get(None, [])))}</ul>') + cut
