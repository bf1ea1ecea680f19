"""The nodes of a decision tree in readable form, for reports and the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import frozen


@frozen(kw_only=True)
class TreeNode:
    """A node: its label, the number of training trials that reach it, and the number of these with another label.

    `parent` is the index of the parent node, None for the root; `branch` is the condition under which the parent leads
    here, in words and units. A node without children is a leaf. Parents come before their children.
    """

    label: str
    trials: float
    wrong: float
    parent: int | None = None
    branch: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {name: getattr(self, name) for name in TreeNode.__annotations__}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> TreeNode:
        """Return the node that `as_json` gave."""
        return cls(**values)
