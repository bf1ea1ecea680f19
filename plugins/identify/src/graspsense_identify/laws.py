"""The candidates: which terms an object may have, which of their parameters are free, and where a fit starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense_identify.gas import AREA_M2, FIXED, LENGTH, RESISTANCE, STIFFNESS, parameters_of
from graspsense_sim_gripper.run.identification import (
    Elastic,
    Foam,
    Gas,
    Loss,
    Maxwell,
    Rigid,
    Snap,
    Switchable,
    find_term,
)

Floats = NDArray[np.float64]

SLOTS: Final = ("elastic", "rigid", "maxwell", "maxwell", "loss", "foam", "snap", "gas")
"""The terms of the compiled law, of which a candidate switches some on. All candidates share its code."""
ELASTIC, RIGID, MAXWELL, SECOND, LOSS, FOAM, SNAP, GAS = range(len(SLOTS))
MAX_STARTS: Final = 40


class DataScale(NamedTuple):
    """The size of the recorded squeezes, from which ranges and starts follow."""

    force_n: float
    depth_m: float
    load_s: float
    memory_s: float
    """The longest time over which a memory of the object shows: the compression and the hold."""
    sample_s: float
    """Time between samples of the force."""


@frozen(kw_only=True)
class FreeParameter:
    """A parameter that is fitted, by its logarithm: its slot, its name, its range, and values to start from.

    These are positive; the parameter of the term is `sign` times the value. Those of a gas are combinations of the
    parameters of its term (`identify.gas`).
    """

    slot: int
    name: str
    low: float
    high: float
    starts: tuple[float, ...]
    sign: float = 1.0

    @property
    def term(self) -> str:
        """The term, with its number where a candidate may have two of the kind."""
        return f"{SLOTS[self.slot]} 2" if self.slot == SECOND else SLOTS[self.slot]

    @property
    def label(self) -> str:
        """The name with that of its term."""
        return f"{self.term}.{self.name}"

    @property
    def is_force(self) -> bool:
        """Whether it is proportional to the scale of the force: a force, or one per length or speed."""
        return "_n_" in f"{self.name}_"

    @property
    def is_stiffness(self) -> bool:
        """Whether it varies with the stiffness of the object."""
        return self.name in find_term(SLOTS[self.slot])[1].stiffnesses


class FitStart(NamedTuple):
    """Where a fit starts."""

    values: tuple[float, ...]
    """Of the free parameters."""
    wider_m: float
    """By how much the objects are wider than the first estimate."""


@frozen(kw_only=True)
class CandidateLaw:
    """Terms with free and fixed parameters."""

    free: tuple[FreeParameter, ...]
    fixed: Mapping[tuple[int, str], float] = field(factory=dict)
    more_starts: tuple[FitStart, ...] = ()
    """Where a fit starts besides the combinations of the starts of each parameter."""

    @property
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
            words.append(f"elastic ({form})" if slot == ELASTIC else SLOTS[slot])
            if slot == GAS:
                vented = any(parameter.name == RESISTANCE for parameter in self.free)
                words[-1] += " (vented)" if vented else " (closed)"
        return " + ".join(words)

    def can_join(self, other: CandidateLaw) -> bool:
        """Whether it has none of the terms of the other."""
        return not set(self.slots) & set(other.slots)

    def joined(self, other: CandidateLaw) -> CandidateLaw:
        """Return the candidate with the terms of both."""
        return CandidateLaw(free=self.free + other.free, fixed={**self.fixed, **other.fixed})

    def parameters(self, values: Sequence[float]) -> dict[int, dict[str, float]]:
        """Return the parameters of each of its terms, by slot, for these values of the free ones."""
        of_slot: dict[int, dict[str, float]] = {slot: {} for slot in self.slots}
        for (slot, name), value in self.fixed.items():
            of_slot[slot][name] = value
        combined = {}
        for parameter, value in zip(self.free, values, strict=True):
            if parameter.slot == GAS:
                combined[parameter.name] = float(value)
            else:
                of_slot[parameter.slot][parameter.name] = parameter.sign * float(value)
        if combined:
            of_slot[GAS] |= {name: float(value) for name, value in self._of_gas(combined).items()}
        return of_slot

    def _of_gas(self, combined: Mapping[str, Any]) -> dict[str, Any]:
        return parameters_of(combined, self.fixed.get((GAS, "area_m2"), AREA_M2))

    @cached_property
    def active(self) -> NDArray[np.int64]:
        """Whether each of the slots is active (1)."""
        return np.array([int(slot in self.slots) for slot in range(len(SLOTS))])

    @cached_property
    def _numbers(self) -> tuple[Floats, list[int], list[float], list[int]]:
        """The numbers of all terms, of which the free ones are 1, the columns and signs of the free ones but those of a
        gas, and the columns of stiffnesses."""
        numbers, stiff = np.ones(N_NUMBERS), []
        for slot in self.slots:
            term = find_term(SLOTS[slot])[1]
            fixed = {name: value for (own, name), value in self.fixed.items() if own == slot}
            for name, value in {**_defaults(term.params), **fixed}.items():
                numbers[_column(slot, name)] = value
            stiff += [_column(slot, name) for name in term.stiffnesses]
        own = [parameter for parameter in self.free if parameter.slot != GAS]
        return (
            numbers,
            [_column(parameter.slot, parameter.name) for parameter in own],
            [parameter.sign for parameter in own],
            stiff,
        )

    def numbers(self, values: Floats, factors: Floats) -> Floats:
        """Return the numbers of the terms, as `terms_of` reads them, with every stiffness times the factor of its row.

        `values`: (n, free parameters); `factors`: (n,). The result has shape (n, `N_NUMBERS`).
        """
        base, columns, signs, stiff = self._numbers
        numbers = np.tile(base, (len(values), 1))
        own = [i for i, parameter in enumerate(self.free) if parameter.slot != GAS]
        numbers[:, columns] = values[:, own] * np.array(signs)
        if len(own) < len(self.free):
            combined = {
                parameter.name: values[:, i] for i, parameter in enumerate(self.free) if parameter.slot == GAS
            }
            for name, value in self._of_gas(combined).items():
                numbers[:, _column(GAS, name)] = value
        numbers[:, stiff] *= factors[:, np.newaxis]
        return numbers

    def starts(self) -> list[tuple[float, ...]]:
        """Return combinations of the values to start from."""
        return list(product(*(parameter.starts for parameter in self.free)))[:MAX_STARTS]

    def starting_at(self, values: Mapping[str, float]) -> CandidateLaw:
        """Return the candidate that starts at these values, by label, where it has the parameter."""
        free = tuple(
            evolve(parameter, starts=(min(max(values[parameter.label], parameter.low), parameter.high),))
            if parameter.label in values
            else parameter
            for parameter in self.free
        )
        return evolve(self, free=free, more_starts=())


def _defaults(params: Any) -> dict[str, float]:
    return dict(params._field_defaults)


def _column(slot: int, name: str) -> int:
    """Return the column of a parameter among the numbers of all terms."""
    fields: tuple[str, ...] = _PARAMS[slot]._fields
    return _FIRST[slot] + fields.index(name)


_PARAMS: Final[tuple[Any, ...]] = tuple(find_term(kind)[1].params for kind in SLOTS)
_FIRST: Final = tuple(sum(len(param._fields) for param in _PARAMS[:slot]) for slot in range(len(SLOTS)))
"""The first column of each slot."""
N_NUMBERS: Final = sum(len(param._fields) for param in _PARAMS)
"""The number of parameters of the terms of all slots."""


def terms_of(active: Any, numbers: Any, r: int) -> tuple[Switchable, ...]:
    """Return the parameters of the terms of all slots from row r of the numbers.

    It runs compiled, so it spells them out.
    """
    return (
        Switchable(int(active[0]), Elastic(float(numbers[r, 0]), float(numbers[r, 1]))),
        Switchable(int(active[1]), Rigid(float(numbers[r, 2]), float(numbers[r, 3]), float(numbers[r, 4]))),
        Switchable(int(active[2]), Maxwell(float(numbers[r, 5]), float(numbers[r, 6]))),
        Switchable(int(active[3]), Maxwell(float(numbers[r, 7]), float(numbers[r, 8]))),
        Switchable(int(active[4]), Loss(float(numbers[r, 9]))),
        Switchable(
            int(active[5]),
            Foam(
                float(numbers[r, 10]),
                float(numbers[r, 11]),
                float(numbers[r, 12]),
                float(numbers[r, 13]),
                float(numbers[r, 14]),
                float(numbers[r, 15]),
                float(numbers[r, 16]),
            ),
        ),
        Switchable(
            int(active[6]),
            Snap(
                float(numbers[r, 17]),
                float(numbers[r, 18]),
                float(numbers[r, 19]),
                float(numbers[r, 20]),
                float(numbers[r, 21]),
            ),
        ),
        Switchable(
            int(active[7]),
            Gas(
                float(numbers[r, 22]),
                float(numbers[r, 23]),
                float(numbers[r, 24]),
                float(numbers[r, 25]),
                float(numbers[r, 26]),
                float(numbers[r, 27]),
                float(numbers[r, 28]),
                float(numbers[r, 29]),
            ),
        ),
    )


def static_candidates(scale: DataScale) -> list[CandidateLaw]:
    """Return the candidates without memory, the simplest first."""
    force, depth = scale.force_n, scale.depth_m
    k = force / depth
    cubic = force / depth**3
    power = force / depth**1.5
    k1 = FreeParameter(slot=ELASTIC, name="k1_n_m", low=1e-4 * k, high=100.0 * k, starts=(k, 0.4 * k))
    k3 = FreeParameter(
        slot=ELASTIC, name="k3_n_m3", low=1e-4 * cubic, high=100.0 * cubic, starts=(0.5 * cubic, 0.05 * cubic)
    )
    # Down to where the shell has softened completely at a quarter of the compression.
    softening = FreeParameter(
        slot=ELASTIC, name="k3_n_m3", low=1e-3 * cubic, high=20.0 * cubic, starts=(0.3 * cubic,), sign=-1.0
    )
    softer = evolve(k1, starts=(1.3 * k, 2.5 * k))
    hertz = FreeParameter(
        slot=RIGID, name="hertz_n_m15", low=1e-3 * power, high=1e4 * power, starts=(power, 3.0 * power)
    )
    foam = (
        FreeParameter(
            slot=FOAM, name="force_n", low=1e-3 * force, high=100.0 * force, starts=(force, 0.5 * force)
        ),
        FreeParameter(slot=FOAM, name="exponent", low=0.3, high=6.0, starts=(1.2, 2.0)),
    )
    snap = (
        FreeParameter(slot=SNAP, name="k1_n_m", low=0.05 * k, high=100.0 * k, starts=(1.2 * k, 2.0 * k)),
        FreeParameter(
            slot=SNAP,
            name="critical_m",
            low=0.03 * depth,
            high=depth,
            starts=tuple(share * depth for share in (0.25, 0.4, 0.55, 0.7, 0.85)),
        ),
        FreeParameter(slot=SNAP, name="drop_n", low=0.01 * force, high=3.0 * force, starts=(0.2 * force,)),
        FreeParameter(
            slot=SNAP, name="fall_m", low=0.01 * depth, high=2.0 * depth, starts=(0.1 * depth, 0.3 * depth)
        ),
        FreeParameter(slot=SNAP, name="k2_n_m", low=0.01 * k, high=100.0 * k, starts=(k,)),
    )
    return [
        CandidateLaw(free=(k1,)),
        CandidateLaw(free=(hertz,)),
        CandidateLaw(free=(k1, k3)),
        CandidateLaw(free=(softer, softening)),
        CandidateLaw(free=foam, fixed={(FOAM, "at_m"): float(f"{depth:.2g}")}),
        CandidateLaw(free=snap),
        CandidateLaw(free=(evolve(k1, starts=(0.5 * k, 0.1 * k)),)).joined(_closed_gas(scale)),
    ]


def _gas_stiffness(scale: DataScale) -> FreeParameter:
    k = scale.force_n / scale.depth_m
    return FreeParameter(slot=GAS, name=STIFFNESS, low=1e-3 * k, high=100.0 * k, starts=(0.3 * k, k))


def _closed_gas(scale: DataScale) -> CandidateLaw:
    depth = scale.depth_m
    length = FreeParameter(
        slot=GAS, name=LENGTH, low=0.7 * depth, high=100.0 * depth, starts=(1.3 * depth, 3.0 * depth)
    )
    return CandidateLaw(free=(_gas_stiffness(scale), length), fixed=_fixed_gas())


def _vented_gas(scale: DataScale) -> CandidateLaw:
    speed = scale.depth_m / max(scale.load_s, 1e-3)
    drag = scale.force_n / speed**2
    resistance = FreeParameter(
        slot=GAS, name=RESISTANCE, low=1e-4 * drag, high=1e4 * drag, starts=(0.1 * drag, 3.0 * drag)
    )
    fixed = {**_fixed_gas(), (GAS, "area_m2"): AREA_M2}
    return CandidateLaw(free=(_gas_stiffness(scale), resistance), fixed=fixed)


def _fixed_gas() -> dict[tuple[int, str], float]:
    return {(GAS, name): value for name, value in FIXED.items()}


def memories(scale: DataScale) -> list[CandidateLaw]:
    """Return the terms with a memory that a candidate may have beside the others, the simplest first."""
    k = scale.force_n / scale.depth_m
    shortest, longest = 0.3 * scale.sample_s, 5.0 * scale.memory_s
    rate = scale.depth_m / max(scale.load_s, 1e-3)

    def branch(slot: int, share: float, starts_s: tuple[float, ...]) -> CandidateLaw:
        inside = tuple(min(max(tau, 1.5 * shortest), 0.5 * longest) for tau in starts_s)
        return CandidateLaw(
            free=(
                FreeParameter(
                    slot=slot, name="k_n_m", low=1e-3 * k, high=100.0 * k, starts=(share * k, 2.0 * share * k)
                ),
                FreeParameter(slot=slot, name="tau_s", low=shortest, high=longest, starts=inside),
            )
        )

    damper = scale.force_n / rate
    single = branch(MAXWELL, 0.3, (0.2 * scale.memory_s, 0.03 * scale.memory_s))
    loss = CandidateLaw(
        free=(
            FreeParameter(
                slot=LOSS, name="damping_n_s_m", low=1e-4 * damper, high=10.0 * damper, starts=(0.1 * damper,)
            ),
        )
    )
    fast = branch(MAXWELL, 0.2, (0.04 * scale.memory_s,))
    slow = branch(SECOND, 0.2, (0.4 * scale.memory_s,))
    return [loss, single, fast.joined(slow), single.joined(loss), _vented_gas(scale)]
