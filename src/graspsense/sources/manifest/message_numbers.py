"""Numbers in ROS messages as they come, named as in the manifest of a bag: `'/joint_states.position'[0]*0.001`."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.core.values.errors import ConfigError, listed
from graspsense.sources.formats.ros_format import numbers_in
from graspsense.sources.manifest.expression import OVER_TIME, Expression, parse
from graspsense.sources.units import TO_SI


@frozen
class MessageNumber:
    """A number that is computed of the newest messages of topics.

    `quantity` is what it measures; a unit behind the expression, as in `[mm]`, is taken to SI. Raises ConfigError.
    """

    text: str
    quantity: Literal["gap", "force", "effort", "velocity"]
    _expression: Expression = field(init=False)

    @_expression.default
    def _parsed(self) -> Expression:
        expression = parse(self.text)
        for node in ast.walk(expression.tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in OVER_TIME:
                raise ConfigError(
                    f"{self.text!r}: {node.func.id} is over a whole grasp, which is not known yet"
                )
        for name in expression.names:
            topic, dot, _ = name.partition(".")
            if not (topic.startswith("/") and dot) or set("*?") & set(topic):
                raise ConfigError(f"{self.text!r}: {name!r} is not '/topic.field': write it in quotes")
        if not expression.names:
            raise ConfigError(f"{self.text!r} names no topic: write '/topic.field' in quotes")
        if expression.unit and expression.unit not in TO_SI[self.quantity]:
            units = listed(tuple(TO_SI[self.quantity]))
            raise ConfigError(f"{self.text!r}: the unit {expression.unit!r} is not known. There are {units}")
        return expression

    @property
    def names(self) -> frozenset[str]:
        """The fields that it needs, each `/topic.field`."""
        return frozenset(self._expression.names)

    @property
    def topics(self) -> frozenset[str]:
        """The topics that it needs."""
        return frozenset(name.partition(".")[0] for name in self.names)

    def value(self, columns: Mapping[str, NDArray[np.float64]]) -> float:
        """Return the number in SI units, given the `message_columns` of its topics. Raises ConfigError."""
        factor = TO_SI[self.quantity].get(self._expression.unit, 1.0)
        return float(self._expression.numbers(columns, 1)[0]) * factor


def message_columns(message: Any, topic: str) -> dict[str, NDArray[np.float64]]:
    """Return the numbers in a message as columns with a single row: shape (1,), or (1, k) for an array of k numbers.

    Where a message names the joints of its arrays, as JointState does, each number is also `/topic.field.JOINT`.
    """
    columns, joints = {}, getattr(message, "name", ())
    for name, value in numbers_in(message, topic):
        columns[name] = np.reshape(value, (1, -1) if np.size(value) > 1 else 1)
        if isinstance(joints, list) and np.size(value) == len(joints):
            columns |= {f"{name}.{joint}": np.reshape(value, (-1, 1))[k] for k, joint in enumerate(joints)}
    return columns
