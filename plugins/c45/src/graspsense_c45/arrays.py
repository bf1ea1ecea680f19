"""Names for the arrays of this package: what they hold, and of which type.

Rows of a table are called rows; a node of a tree is an index into the arrays of `splits.Splits`.
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

Elementwise = Any
"""The result of an elementwise function: a number where the arguments are numbers, else an array."""
Real = float | NDArray[np.float64]
"""A number, or an array for a function that works elementwise."""
Integer = int | np.int64
"""An integer in code that is compiled."""
Whole = Integer | NDArray[np.int64]
"""An integer, or an array of integers for a function that works elementwise."""
Truth = bool | np.bool_ | NDArray[np.bool_]
"""A truth value, or an array for a function that works elementwise."""
