"""The fingertips from squeezes of a rigid block: all of the closure beyond the contact is theirs.

Two equal fingertips in series, each with the force k u (1 + (u / h)^2) at its compression u, have the force
k x / 2 + k x^3 / (8 h^2) at the closure x of both (`plant.pads.pad_excess` with exponent 2). That is the law of an
elastic object between rigid fingertips, and it is fitted as such.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import evolve

from graspsense.simulator_api import RecordedSqueeze
from graspsense_identify.delay import lag_beyond_settings
from graspsense_identify.fit import Fitted, fit
from graspsense_identify.forward import RIGID_PADS, ForwardModel
from graspsense_identify.interval import student
from graspsense_identify.laws import scale_of, static_candidates
from graspsense_identify.prepare import Squeeze, prepared
from graspsense_sim_gripper.run.identification import SimConfig

HARDENS_BELOW: Final = 0.8
"""Fingertips count as nonlinear where this lowers the residual below this share of that of linear ones."""
LAW_ERROR: Final = 0.01
"""Standard deviation of the logarithm of the stiffness that the law itself causes, which knows no rate: simulated
fingertips come back within 1.5 %."""
LEAST_SQUEEZES: Final = 3
"""Fewer give no interval."""
EXPONENT: Final = 2.0


def lag_of_block(config: SimConfig, block: Sequence[RecordedSqueeze]) -> float:
    """Return by how much the forces lag beyond the delay of the settings (s); 0 where the squeezes do not show it.

    The fingertips have no memory of their own here, so every lag is one of the sensor. Raises ConfigError if a squeeze
    has no contact or too few measurements of the force.
    """
    ready = [prepared(squeeze, config.force_delay_s) for squeeze in block]
    return lag_beyond_settings(_fitted(ready))


def with_fingertips_of_block(
    config: SimConfig, block: Sequence[Squeeze], lag_s: float = 0.0
) -> tuple[SimConfig, str]:
    """Return the settings with the fingertips that squeezes of a rigid block show, and a sentence about them.

    `lag_s`: by how much their forces lag beyond the delay of the settings.
    """
    linear, hardens = _fitted(block)
    fitted = hardens if hardens.rms <= HARDENS_BELOW * linear.rms else linear
    k = 2.0 * fitted.values[0]
    hardening_m = math.sqrt(k / (8.0 * fitted.values[1])) if fitted is hardens else None
    stiffness = f"{k:.4g} N/m each"
    n = len(block)
    if n >= LEAST_SQUEEZES:
        scatter = float(np.std(np.log(fitted.factors), ddof=1)) / math.sqrt(n)
        half = student(n - 1) * math.hypot(scatter, LAW_ERROR)
        stiffness += f" (90 %: {k * math.exp(-half):.4g} to {k * math.exp(half):.4g})"
    stiffness += (
        ", linear" if hardening_m is None else f", twice the linear force at {1e3 * hardening_m:.2g} mm"
    )
    squeezes = "a squeeze" if n == 1 else f"{n} squeezes"
    source = (
        "the delay of the settings" if lag_s == 0.0 else "which these squeezes show, and the settings do not"
    )
    said = (
        f"the fingertips follow from {squeezes} of the block: {stiffness}; residual {100 * fitted.rms:.2f} % of the "
        f"peak; their force is late by {1e3 * (config.force_delay_s + lag_s):.3g} ms, {source}"
    )
    changed = evolve(
        config, pad_stiffness_n_m=k, pad_hardening_m=hardening_m, pad_exponent=EXPONENT, pad_creep_n_m=0.0
    )
    return changed, said


def _fitted(block: Sequence[Squeeze]) -> list[Fitted]:
    """Return the fits of linear fingertips, and of those that harden."""
    laws = static_candidates(scale_of(block))
    return [fit(ForwardModel(pads=RIGID_PADS), laws[k], block) for k in (0, 2)]
