"""Names for the arrays of this package: what they hold, and of which type.

Rows of a table are called rows; a node of a tree is an index into the arrays of `tree.Splits`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
"""Values of attributes, weights in rows, probabilities, gains in bits."""
Indices = NDArray[np.int64]
"""Indices of rows, nodes, attributes, classes or values, and numbers of such."""
FixedPoint = NDArray[np.int64]
"""Weights or ``x ln x`` terms as integers, in units of a power of two (see `arithmetic.Scale`)."""
Mask = NDArray[np.bool_]
"""One truth value per item."""
NodeColumn = NDArray[np.int32]
"""One integer per node or row: a feature, a child, a number of children, the node of a row."""
SmallLabels = NDArray[Any]
"""Class indices in the smallest type that holds them."""
AnyArray = NDArray[Any]
"""Integers or numbers, as the function says."""

Integers = list[int] | NDArray[Any]
"""Integers of code that is also compiled: the interpreter has them in a list, which it reads faster than an array."""
IntegerTable = list[list[int]] | NDArray[Any]
"""The same in rows of equal length."""
Numbers = list[float] | NDArray[np.float64]
"""Numbers of code that is also compiled."""
NumberTable = list[list[float]] | NDArray[np.float64]
"""The same in rows of equal length."""
Truths = list[bool] | NDArray[np.bool_]
"""Truth values of code that is also compiled."""
