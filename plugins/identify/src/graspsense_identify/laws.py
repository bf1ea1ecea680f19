"""The candidates: which terms an object may have, which of their parameters are free, and where a fit starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense_identify.prepare import Squeeze
from graspsense_sim_gripper.run.identification import Switchable, find_term

Values = Sequence[float] | NDArray[np.float64]
"""Values of the free parameters of a candidate."""

SLOTS: Final = ("elastic", "rigid", "maxwell", "loss", "foam", "snap")
"""The terms of the compiled law, of which a candidate switches some on. All candidates share its code."""
ELASTIC, RIGID, MAXWELL, LOSS, FOAM, SNAP = range(len(SLOTS))
MAX_STARTS: Final = 40
NO_FALL: Final = 1e-4
"""Length of the fall of a law with two slopes, over the compression."""


class DataScale(NamedTuple):
    """The size of the recorded squeezes, from which ranges and starts follow."""

    force_n: float
    depth_m: float
    speed_m_s: float
    """The speed of the compression."""
    memory_s: float
    """The longest time over which a memory of the object shows: the compression and the hold."""
    sample_s: float
    """Time between samples of the force."""


def scale_of(squeezes: Sequence[Squeeze]) -> DataScale:
    """Return the size of these squeezes."""
    times = [squeeze.stretches for squeeze in squeezes]
    depth_m = float(np.median([squeeze.depth_m for squeeze in squeezes]))
    return DataScale(
        force_n=float(np.median([squeeze.peak_n for squeeze in squeezes])),
        depth_m=depth_m,
        speed_m_s=depth_m / max(float(np.median([timing.load_s for timing in times])), 1e-3),
        memory_s=max(timing.load_s + timing.hold_s for timing in times),
        sample_s=float(np.median([np.median(np.diff(squeeze.t_s[squeeze.sample])) for squeeze in squeezes])),
    )


@frozen(kw_only=True)
class FreeParameter:
    """A parameter that is fitted, by its logarithm: its slot, its name, its range, and values to start from.

    These are positive; the parameter of the term is `sign` times the value.
    """

    slot: int
    name: str
    low: float
    high: float
    starts: tuple[float, ...]
    sign: float = 1.0

    @property
    def label(self) -> str:
        """The name with that of its term."""
        return f"{SLOTS[self.slot]}.{self.name}"

    @property
    def is_force(self) -> bool:
        """Whether it is proportional to the scale of the force: a force, or one per length or speed."""
        return "_n_" in f"{self.name}_"

    @cached_property
    def is_stiffness(self) -> bool:
        """Whether it varies with the stiffness of the object."""
        return self.name in TERMS[self.slot].stiffnesses


@frozen(kw_only=True)
class CandidateLaw:
    """Terms with free and fixed parameters."""

    free: tuple[FreeParameter, ...]
    fixed: Mapping[tuple[int, str], float] = field(factory=dict)
    more_starts: tuple[tuple[float, ...], ...] = ()
    """Where a fit starts besides the combinations of the starts of each parameter."""

    @cached_property
    def slots(self) -> tuple[int, ...]:
        """The slots of its terms."""
        return tuple(sorted({parameter.slot for parameter in self.free}))

    @property
    def name(self) -> str:
        """Its terms in words; an elastic term without a cubic part is a spring."""
        words = []
        for slot in self.slots:
            cubic = [parameter.sign for parameter in self.free if parameter.name == "k3_n_m3"]
            form = "softening" if cubic == [-1.0] else "k1, k3" if cubic else "k1"
            kinks = (SNAP, "fall_m") in self.fixed
            bent = f"{SLOTS[slot]} (two slopes)" if slot == SNAP and kinks else SLOTS[slot]
            words.append(f"elastic ({form})" if slot == ELASTIC else bent)
        return " + ".join(words)

    def joined(self, other: CandidateLaw) -> CandidateLaw:
        """Return the candidate with the terms of both."""
        return CandidateLaw(free=self.free + other.free, fixed={**self.fixed, **other.fixed})

    def parameters(self, values: Values, factor: float = 1.0) -> dict[int, dict[str, float]]:
        """Return the parameters of each of its terms, by slot, for these values of the free ones.

        Every stiffness is multiplied by `factor`.
        """
        of_slot: dict[int, dict[str, float]] = {slot: {} for slot in self.slots}
        for (slot, name), value in self.fixed.items():
            of_slot[slot][name] = value
        for parameter, value in zip(self.free, values, strict=True):
            scale = parameter.sign * factor if parameter.is_stiffness else parameter.sign
            of_slot[parameter.slot][parameter.name] = scale * float(value)
        return of_slot

    def terms(self, values: Values, factor: float = 1.0) -> tuple[Switchable, ...]:
        """Return the terms of all slots with these parameters, those of other candidates switched off."""
        terms = list(SWITCHED_OFF)
        for slot, own in self.parameters(values, factor).items():
            terms[slot] = Switchable(1, TERMS[slot].params(**own))
        return tuple(terms)

    def starts(self) -> list[tuple[float, ...]]:
        """Return combinations of the values to start from."""
        return list(product(*(parameter.starts for parameter in self.free)))[:MAX_STARTS]

    def starting_at(self, values: Values) -> CandidateLaw:
        """Return the candidate whose first parameters start at these values."""
        begun = zip(self.free, values, strict=False)
        free = tuple(evolve(parameter, starts=(float(value),)) for parameter, value in begun)
        return evolve(self, free=free + self.free[len(free) :], more_starts=())


TERMS: Final = tuple(find_term(kind)[1] for kind in SLOTS)
SWITCHED_OFF: Final = tuple(Switchable(0, term.params(*(1.0 for _ in term.params._fields))) for term in TERMS)


def _free(
    slot: int, name: str, unit: float, limits: tuple[float, float], *starts: float, sign: float = 1.0
) -> FreeParameter:
    """Return a free parameter whose range and starts are given in a unit of the squeezes."""
    low, high = (limit * unit for limit in limits)
    inside = tuple(start * unit for start in starts)
    return FreeParameter(slot=slot, name=name, low=low, high=high, starts=inside, sign=sign)


def static_candidates(scale: DataScale) -> list[CandidateLaw]:
    """Return the candidates without memory, the simplest first."""
    force, depth = scale.force_n, scale.depth_m
    k, cubic, power = force / depth, force / depth**3, force / depth**1.5
    k1 = _free(ELASTIC, "k1_n_m", k, (1e-4, 100.0), 1.0, 0.4)
    k3 = _free(ELASTIC, "k3_n_m3", cubic, (1e-4, 100.0), 0.5, 0.05)
    stiffer = _free(ELASTIC, "k1_n_m", k, (1e-4, 100.0), 1.3, 2.5)
    # Down to where the shell has softened completely at a quarter of the compression.
    softening = _free(ELASTIC, "k3_n_m3", cubic, (1e-3, 20.0), 0.3, sign=-1.0)
    hertz = _free(RIGID, "hertz_n_m15", power, (1e-3, 1e4), 1.0, 3.0)
    foam = (
        _free(FOAM, "force_n", force, (1e-3, 100.0), 1.0, 0.5),
        _free(FOAM, "exponent", 1.0, (0.3, 6.0), 1.2, 2.0),
    )
    snap = (
        _free(SNAP, "k1_n_m", k, (0.05, 100.0), 1.2, 2.0),
        _free(SNAP, "critical_m", depth, (0.03, 1.0), 0.25, 0.4, 0.55, 0.7, 0.85),
        _free(SNAP, "drop_n", force, (0.01, 3.0), 0.2),
        _free(SNAP, "fall_m", depth, (0.01, 2.0), 0.1, 0.3),
        _free(SNAP, "k2_n_m", k, (0.01, 100.0), 1.0),
    )
    slopes = (
        _free(SNAP, "k1_n_m", k, (0.01, 100.0), 0.6, 1.2, 2.0),
        _free(SNAP, "critical_m", depth, (0.03, 1.0), 0.2, 0.35, 0.5, 0.65, 0.8),
        _free(SNAP, "k2_n_m", k, (0.01, 100.0), 0.4, 2.0),
    )
    # A shell that falls by nothing, over a length that no recording shows.
    no_fall = {(SNAP, "drop_n"): 0.0, (SNAP, "fall_m"): float(f"{NO_FALL * depth:.2g}")}
    return [
        CandidateLaw(free=(k1,)),
        CandidateLaw(free=(hertz,)),
        CandidateLaw(free=(k1, k3)),
        CandidateLaw(free=(stiffer, softening)),
        CandidateLaw(free=slopes, fixed=no_fall),
        CandidateLaw(free=foam, fixed={(FOAM, "at_m"): float(f"{depth:.2g}")}),
        CandidateLaw(free=snap),
    ]


def memories(scale: DataScale) -> list[CandidateLaw]:
    """Return the terms with a memory that a candidate may have beside the others, the simplest first."""
    k = scale.force_n / scale.depth_m
    # A branch that relaxes between two measurements is a damper.
    shortest, longest = 0.6 * scale.sample_s, 5.0 * scale.memory_s
    times_s = [min(max(part * scale.memory_s, shortest), 0.5 * longest) for part in (0.2, 0.03)]
    stiffness = _free(MAXWELL, "k_n_m", k, (1e-3, 100.0), 0.3, 0.6)
    branch = CandidateLaw(free=(stiffness, _free(MAXWELL, "tau_s", 1.0, (shortest, longest), *times_s)))
    damping = _free(LOSS, "damping_n_s_m", scale.force_n / scale.speed_m_s, (1e-4, 10.0), 0.1)
    loss = CandidateLaw(free=(damping,))
    return [loss, branch, branch.joined(loss)]
