"""A decision tree as a person reads it: what a classifier that has one gives for a page or a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import frozen


@frozen(kw_only=True)
class TreeNode:
    """A node: the label it would answer, how many training trials came to it, and how many of these it gets wrong.

    `parent` is the number of the node above it, None for the root; `branch` says what leads here from there, in
    words and units. A node that is nobody's parent is a leaf. Nodes come with parents before their sons.
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
