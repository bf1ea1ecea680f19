"""The fingertips from squeezes of a rigid block: all of the closure beyond the contact is theirs.

Two equal fingertips in series, each with the force k u (1 + (u / h)^2) at its compression u, have the force
k x / 2 + k x^3 / (8 h^2) at the closure x of both (`dynamics.contact.hardening` with exponent 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import evolve, frozen

from graspsense.simulator_api import RecordedSqueeze
from graspsense_identify.choose import LEAST_GAIN
from graspsense_identify.delay import EVIDENCE
from graspsense_identify.fit import LAG_UNIT_S, LEAST_ERROR
from graspsense_identify.interval import student
from graspsense_identify.prepare import FULL, MAX_LAG_S, Squeeze, prepared
from graspsense_sim_gripper.run.identification import SimConfig

HARDENS_BELOW: Final = 0.8
"""Fingertips count as nonlinear where this lowers the residual below this share of that of linear ones."""
LAW_ERROR: Final = 0.01
"""Standard deviation of the logarithm of the stiffness that the law itself causes, which knows no rate: simulated
fingertips come back within 1.5 %."""
LEAST_SQUEEZES: Final = 3
"""Fewer give no interval."""
EXPONENT: Final = 2.0


@frozen
class _Fit:
    stiffness_n_m: float
    hardening_m: float | None
    residual: float
    """The rms residual over the peak force."""
    lag_s: float


def lag_of_block(config: SimConfig, block: Sequence[RecordedSqueeze]) -> float:
    """Return by how much the forces lag beyond the delay of the settings (s); 0 where the squeezes do not show it.

    The fingertips have no memory of their own here, so every lag is one of the sensor. Raises ConfigError if a squeeze
    has no contact or too few measurements of the force.
    """
    ready = [prepared(squeeze, config.force_delay_s) for squeeze in block]
    n = sum(len(squeeze.force_n) for squeeze in ready)
    own, lagging = (_fitted(ready, hardens=True, has_lag=has_lag) for has_lag in (False, True))
    gain = math.log(_error(own) / _error(lagging))
    shown = n * gain - 0.5 * math.log(n) > EVIDENCE and gain > -math.log(1.0 - LEAST_GAIN)
    return lagging.lag_s if shown and abs(lagging.lag_s) < 0.98 * MAX_LAG_S else 0.0


def _error(fit: _Fit) -> float:
    return math.hypot(fit.residual, LEAST_ERROR)


def with_fingertips_of_block(
    config: SimConfig, block: Sequence[RecordedSqueeze], share: Sequence[float], lag_s: float = 0.0
) -> tuple[SimConfig, str]:
    """Return the settings with the fingertips that squeezes of a rigid block show, and a sentence about them.

    `share`: the part of the force that the cells measure, for each squeeze. `lag_s`: by how much the forces lag beyond
    the delay of the settings. Raises ConfigError if a squeeze has no contact or too few measurements of the force.
    """
    ready = [prepared(squeeze, config.force_delay_s, FULL, lag_s) for squeeze in block]
    ready = [
        evolve(squeeze, force_n=squeeze.force_n / part) for squeeze, part in zip(ready, share, strict=True)
    ]
    linear = _fitted(ready, hardens=False)
    fit = _fitted(ready, hardens=True)
    if fit.hardening_m is None or fit.residual > HARDENS_BELOW * linear.residual:
        fit = linear
    k = fit.stiffness_n_m
    stiffness = f"{k:.4g} N/m each"
    if len(ready) >= LEAST_SQUEEZES:
        alone = np.log(
            [_fitted([squeeze], hardens=fit.hardening_m is not None).stiffness_n_m for squeeze in ready]
        )
        scatter = float(np.std(alone, ddof=1)) / math.sqrt(len(alone))
        half = student(len(alone) - 1) * math.hypot(scatter, LAW_ERROR)
        stiffness += f" (90 %: {k * math.exp(-half):.4g} to {k * math.exp(half):.4g})"
    stiffness += (
        ", linear"
        if fit.hardening_m is None
        else f", twice the linear force at {1e3 * fit.hardening_m:.2g} mm"
    )
    squeezes = "a squeeze" if len(ready) == 1 else f"{len(ready)} squeezes"
    said = f"the fingertips follow from {squeezes} of the block: {stiffness}; residual {fit.residual:.2%} of the peak; "
    said += f"their force is late by {1e3 * (config.force_delay_s + lag_s):.3g} ms, "
    said += (
        "the delay of the settings" if lag_s == 0.0 else "which these squeezes show, and the settings do not"
    )
    changed = evolve(
        config, pad_stiffness_n_m=k, pad_hardening_m=fit.hardening_m, pad_exponent=EXPONENT, pad_creep_n_m=0.0
    )
    return changed, said


def _fitted(squeezes: Sequence[Squeeze], *, hardens: bool, has_lag: bool = False) -> _Fit:
    """Return the least-squares fit of one law of the fingertips, and of the width of the block in each squeeze.

    `has_lag`: whether the lag of the force is fitted, too.
    """
    from scipy.optimize import least_squares

    peak = float(np.median([squeeze.peak_n for squeeze in squeezes]))
    depth = max(float(np.median([squeeze.depth_m for squeeze in squeezes])), 1e-6)
    start_n_m = 2.0 * peak / depth

    def residuals(point: np.ndarray) -> np.ndarray:
        k, cubic = math.exp(point[0]), point[1] if hardens else 0.0
        parts = []
        for squeeze, width in zip(squeezes, point[-len(squeezes) :], strict=True):
            gap = squeeze.delayed(LAG_UNIT_S * point[1 + hardens]).gap_m if has_lag else squeeze.gap_m
            x = np.maximum(squeeze.width_m + depth * width - gap, 0.0)
            parts.append(
                (squeeze.at_samples(0.5 * k * x * (1.0 + cubic * (x / depth) ** 2)) - squeeze.force_n) / peak
            )
        return np.concatenate(parts)

    start = [
        math.log(start_n_m),
        *([0.1] if hardens else []),
        *([0.0] if has_lag else []),
        *([0.0] * len(squeezes)),
    ]
    most = MAX_LAG_S / LAG_UNIT_S
    low = [-np.inf, *([0.0] if hardens else []), *([-most] if has_lag else []), *([-2.0] * len(squeezes))]
    high = [np.inf, *([1e3] if hardens else []), *([most] if has_lag else []), *([2.0] * len(squeezes))]
    done = least_squares(residuals, start, bounds=(low, high), x_scale="jac")
    cubic = float(done.x[1]) if hardens else 0.0
    # k x^3 / (8 h^2) = k x / 2 * cubic (x / depth)^2
    hardening = depth / (2.0 * math.sqrt(cubic)) if cubic > 0.0 else None
    lag_s = LAG_UNIT_S * float(done.x[1 + hardens]) if has_lag else 0.0
    return _Fit(float(math.exp(done.x[0])), hardening, float(np.sqrt(np.mean(done.fun**2))), lag_s)
