"""The matrix exponential and its integral, for a tick and for its repeated halves tick / 2^k."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_BISECTIONS: Final = 34
"""Events are located to tick / 2^34: 6e-14 s for a tick of 1 ms."""
TAYLOR_TERMS: Final = 13
EXTRA_HALVINGS: Final = 3
"""The Taylor series is summed for a duration h at which the norm of A h is at most 2^-3."""


def exponentials(rates: Array, dt_s: float) -> tuple[Array, Array]:
    """Return exp(A h) and its integral over 0 to h, for h = dt_s / 2^k with k = 0 ... MAX_BISECTIONS.

    `rates` are matrices A (1/s), shape (n_modes, n, n). The results have the shape (n_modes, MAX_BISECTIONS + 1, n, n).

    Scaling and squaring (N. J. Higham, "The scaling and squaring method for the matrix exponential revisited", SIAM
    Journal on Matrix Analysis and Applications 26, 2005), with a Taylor series in place of the Padé approximant. The
    repeated squaring passes through all durations that are needed. E - I is squared instead of E = exp(A h), so that
    small entries are not lost beside I to rounding. With the integral S,

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
