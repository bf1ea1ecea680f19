"""The tables by which numpy draws standard normal numbers, read off numpy itself.

numpy uses the ziggurat method of Marsaglia and Tsang (Journal of Statistical Software 5(8), 2000) with 256 layers of
equal area under the density exp(-x^2 / 2). Of 64 random bits the lowest eight choose a layer, one the sign, and 52 a
place in the layer. The numbers of a layer are this place times a factor; below a bound they are accepted at once.
numpy rounds both in its own way, so that they are read off what it draws from bits that are set.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

LAYERS: Final = 256
PLACES: Final = 1 << 52
"""Number of places in a layer."""
TAIL: Final = 3.6541528853610088
"""Where the layer of the tail begins."""
_ACCEPTED: Final = 1 << 40
"""A place near 0 that every layer accepts."""


class Ziggurat(NamedTuple):
    """The tables, as arrays that compiled code reads."""

    factors: NDArray[np.float64]
    """(512,) The number for each place of a layer; from 256 on its negative."""
    bounds: NDArray[np.uint64]
    """(256,) The place of a layer below which it is accepted at once."""
    densities: NDArray[np.float64]
    """(256,) The density at the outer end of each layer."""


class _ChosenBits:
    """Draws of numpy from bits that are set."""

    def __init__(self) -> None:
        self._bits = np.random.PCG64(0)
        self._draw = np.random.Generator(self._bits).standard_normal

    def drawn(self, layer: int, place: int) -> tuple[float, bool]:
        """Return what numpy draws from a place of a layer, and whether it accepts it at once."""
        # From the state 0, the next state of PCG64 is its increment, and if that has 64 bits only, these are drawn.
        word = place << 9 | layer
        self._bits.state = {
            "bit_generator": "PCG64",
            "state": {"state": 0, "inc": word},
            "has_uint32": 0,
            "uinteger": 0,
        }
        number = float(self._draw())
        return number, self._bits.state["state"]["state"] == word


def ziggurat_of_numpy() -> Ziggurat:
    """Return the tables of numpy."""
    numpy = _ChosenBits()
    # Multiplication by a power of two is exact. Layer 1 accepts no place at once, but this one after a second look.
    factors = [numpy.drawn(layer, _ACCEPTED)[0] / _ACCEPTED for layer in range(LAYERS)]
    outer = np.array(factors) * PLACES
    inner = np.concatenate([[TAIL, 0.0], outer[1:-1]])
    bounds = [_bound(numpy, layer, int(inner[layer] / outer[layer] * PLACES)) for layer in range(LAYERS)]
    densities = np.exp(-0.5 * outer * outer)
    # The layer of the tail has no outer end.
    densities[0] = 1.0
    return Ziggurat(
        np.array([*factors, *(-factor for factor in factors)]), np.array(bounds, np.uint64), densities
    )


def _bound(numpy: _ChosenBits, layer: int, guess: int) -> int:
    """Return the first place of a layer that numpy does not accept at once; `guess` is near it."""
    while numpy.drawn(layer, guess)[1]:
        guess += 1
    while guess > 0 and not numpy.drawn(layer, guess - 1)[1]:
        guess -= 1
    return guess
