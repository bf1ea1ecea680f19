"""The matrix exponential and its integral, for a tick and its repeated halves."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_BISECTIONS: Final = 34
"""Events are located to a tick over two to this power: 6e-14 s of 1 ms."""
TAYLOR_TERMS: Final = 13
EXTRA_HALVINGS: Final = 3
"""The series is summed where the norm of the matrix is below two to the power of minus this."""


def exponentials(rates: Array, dt_s: float) -> tuple[Array, Array]:
    """Return exp(A h) and its integral over 0 to h, for h = dt_s / 2^k with k = 0 ... MAX_BISECTIONS.

    `rates` are matrices A (1/s), shape (n_modes, n, n). The results have the shape (n_modes, MAX_BISECTIONS + 1, n, n).

    Scaling and squaring (N. J. Higham, "The scaling and squaring method for the matrix exponential revisited", SIAM
    Journal on Matrix Analysis and Applications 26, 2005), with a Taylor series in place of the Padé approximant, since
    all the halved durations occur on the way. E - I is squared rather than E = exp(A h), so that small changes are not
    lost beside I. With the integral S,

        E(2h) - I = 2 (E - I) + (E - I)²,        S(2h) = 2 S + (E - I) S.

    The integral gives the response to constant inputs, as in C. F. Van Loan, "Computing integrals involving the matrix
    exponential", IEEE Transactions on Automatic Control 23, 1978.
    """
    size = rates.shape[-1]
    norm = float(np.abs(rates).sum(axis=-1).max()) * math.ldexp(dt_s, -MAX_BISECTIONS)
    halvings = MAX_BISECTIONS + max(0, math.ceil(math.log2(max(norm, 1e-300))) + EXTRA_HALVINGS)
    h = math.ldexp(dt_s, -halvings)
    scaled, eye = rates * h, np.eye(size)
    term, less_eye, integral = np.broadcast_to(eye, rates.shape), np.zeros_like(rates), h * eye
    for k in range(1, TAYLOR_TERMS + 1):
        term = term @ scaled / k
        less_eye = less_eye + term
        integral = integral + h / (k + 1) * term
    results = []
    for k in range(halvings, -1, -1):
        if k <= MAX_BISECTIONS:
            results.append((eye + less_eye, integral))
        integral = 2.0 * integral + less_eye @ integral
        less_eye = 2.0 * less_eye + less_eye @ less_eye
    maps, integrals = zip(*reversed(results), strict=True)
    return np.stack(maps, axis=1), np.stack(integrals, axis=1)
