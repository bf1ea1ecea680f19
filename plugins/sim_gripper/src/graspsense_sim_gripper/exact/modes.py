"""The modes of a piecewise-linear scene and their matrices.

A mode is a combination of contact (free, compressed), motion (stuck, closing, opening) and the states of the terms' own
contacts. Within a mode the scene is the linear system

    x' = A x + B u,        x = (D, V, δ, p, a, s, e),        u = (E, c)

    D  closure (m): width of the object less the gap
    V  closing speed (m/s)
    δ  compression of the object (m); a state if the object can separate from the pads
    p  compression of the pads (m); a state if they damp or creep
    a  force of the pads' Maxwell branch (N); a state if p is
    s  states of the terms
    e  effort of the drive (N); a state if the drive lags
    E  commanded effort (N), constant over the tick
    c  constant part of friction (N), if the drive has friction

With the force N on a pad and friction F the equations of motion are

    D' = V,    m V' = e - N - b V - F,    F = ±(c + μ N) while sliding,    V = V' = 0 while stuck,
    e' = (E - e) / T,

and the pads and the object both carry N:

    N = k_p p + g_p p' + a,        a' = k_a p' - a / τ,                     (pads)
    N = k δ + g δ' + f·s,          s' = A_s s + b_s δ + c_s δ',             (all terms together)

In contact p = D - δ, and δ' follows from the equality of both. Without contact both are 0. An equation without dampers
is differentiated with respect to time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.dynamics.contact import PadCompliance
from graspsense_sim_gripper.exact.expm import Array
from graspsense_sim_gripper.terms.term import LinearForm, OwnContact

STUCK, CLOSING, OPENING = range(3)
FORCE, FORCE_RATE, FIRST_GUARD = range(3)
"""Indices of the outputs of a mode: force on a pad (N), its rate (N/s), then the guards, which end the mode below 0."""
GAP_TOL_M: Final = 1e-15
FORCE_TOL_N: Final = 1e-9
"""A guard below 0 by less than this is rounding."""


class LinearScene(NamedTuple):
    """The parameters of the modes. The constant part of friction is an input and not among them."""

    mass_kg: float
    damping_n_s_m: float
    has_friction: bool
    load_friction_coefficient: float
    lag_s: float
    pads: PadCompliance
    forms: tuple[LinearForm | OwnContact, ...]


class Shape(NamedTuple):
    """The layout of states, modes and outputs. Code that propagates the state is specialised for it."""

    n_states: int
    n_columns: int
    """States and inputs."""
    separable: int
    """1: the object can separate from the pads, and its compression is a state."""
    pad_states: int
    """1: the pads damp or creep; their compression and the force of their Maxwell branch are states."""
    lags: int
    """1: the effort of the drive is a state."""
    n_motions: int
    """3: stuck, closing, opening; 1: no friction, so that these do not differ."""
    n_contacts: int
    """Number of contacts of the terms' own."""
    n_guards: int
    """One for each contact of the terms, one if the object is separable, two for the motion if there is friction."""


class ModeMatrices(NamedTuple):
    """One mode."""

    rates: Array
    """A and B, with rows of zeros for the inputs: shape (n_columns, n_columns)."""
    force: Array
    """The row that gives the force on a pad."""
    reset: Array
    """Two rows: δ and p immediately after the mode is entered from another contact state."""
    guards: Array
    """Rows that are not negative while the mode lasts."""
    guard_tol: list[float]


class Layout:
    """The places of the states and inputs in x, and rows that select them."""

    def __init__(self, scene: LinearScene) -> None:
        self.scene = scene
        self.rigid_pads = scene.pads.stiffness_n_m == math.inf
        self.separable = not (self.rigid_pads and all(_only_pushes(form) for form in scene.forms))
        self.pad_states = not self.rigid_pads and (
            scene.pads.damping_n_s_m > 0.0 or scene.pads.branch_n_m > 0.0
        )
        self.lags = scene.lag_s > 0.0
        self.has_friction = scene.has_friction or scene.load_friction_coefficient > 0.0
        self.n_contacts = sum(isinstance(form, OwnContact) for form in scene.forms)
        at = 2 + int(self.separable) + 2 * int(self.pad_states)
        self.places = []
        for form in scene.forms:
            n_states = len((form.touching if isinstance(form, OwnContact) else form).rates)
            self.places.append(slice(at, at + n_states))
            at += n_states
        self.n_states = at + int(self.lags)
        self.n_columns = self.n_states + 1 + int(self.has_friction)

    @property
    def shape(self) -> Shape:
        """The layout as numbers."""
        return Shape(
            self.n_states,
            self.n_columns,
            int(self.separable),
            int(self.pad_states),
            int(self.lags),
            3 if self.has_friction else 1,
            self.n_contacts,
            self.n_contacts + int(self.separable) + 2 * int(self.has_friction),
        )

    def row(self, *places: int) -> Array:
        """Return the row that sums these states and inputs; without any, a row of zeros."""
        row = np.zeros(self.n_columns)
        row[list(places)] = 1.0
        return row

    @property
    def compression(self) -> Array:
        """The row of δ, which is D where it is not a state."""
        return self.row(2 if self.separable else 0)

    @property
    def pad(self) -> Array:
        """The row of p; zeros where it is not a state."""
        return self.row(3) if self.pad_states else self.row()

    @property
    def branch(self) -> Array:
        """The row of a; zeros where it is not a state."""
        return self.row(4) if self.pad_states else self.row()

    @property
    def effort(self) -> Array:
        """The row of e, which is E where the drive does not lag."""
        return self.row(self.n_states - 1 if self.lags else self.n_states)

    @property
    def friction(self) -> Array:
        """The row of c."""
        return self.row(self.n_states + 1) if self.has_friction else self.row()

    def modes(self) -> Iterator[tuple[bool, int, int]]:
        """Yield whether the object is compressed, the motion, and a bit for each closed contact of the terms' own."""
        compressed = (False, True) if self.separable else (True,)
        motions = (STUCK, CLOSING, OPENING) if self.has_friction else (CLOSING,)
        return product(compressed, motions, range(1 << self.n_contacts))


def mode_matrices(layout: Layout, mode: tuple[bool, int, int]) -> ModeMatrices | None:
    """Return the matrices of a mode; None where the equations of force leave δ' undetermined."""
    compressed, motion, contacts = mode
    scene = layout.scene
    compression = layout.row(0) if compressed and layout.rigid_pads else layout.compression
    speed = layout.row(1) if motion != STUCK else layout.row()
    terms = _terms(layout, contacts, compression)
    balance = (
        _in_contact(layout, terms, compression, speed)
        if compressed
        else _separated(layout, terms, compression)
    )
    if balance is None:
        return None
    force = layout.row()
    if compressed:
        # Of two equal forces, that of the softer spring has the smaller rounding error.
        force = terms.spring_n_m * compression + terms.damper_n_s_m * balance.rate + terms.own
        softer_pads = not layout.rigid_pads and scene.pads.stiffness_n_m < terms.spring_n_m + terms.gain_n_m
        if softer_pads and _pads(layout)[0] == 0.0:
            force = scene.pads.stiffness_n_m * (layout.row(0) - compression) + layout.branch
    rates = np.zeros((layout.n_columns, layout.n_columns))
    rates[0] = speed
    if motion != STUCK:
        direction = 0.0 if not layout.has_friction else 1.0 if motion == CLOSING else -1.0
        friction = direction * (layout.friction + scene.load_friction_coefficient * force)
        rates[1] = (layout.effort - force - friction - scene.damping_n_s_m * speed) / scene.mass_kg
    _add_state_rates(rates, layout, terms, balance, compression)
    guards, guard_tol = _guards(layout, mode, force)
    guards, guard_tol = [*terms.guards, *guards], [GAP_TOL_M] * len(terms.guards) + guard_tol
    rows = np.array(guards) if guards else np.zeros((0, layout.n_columns))
    return ModeMatrices(rates, force, np.array(balance.reset), rows, guard_tol)


def _only_pushes(form: LinearForm | OwnContact) -> bool:
    """Return whether the force is that of a contact spring, so that it never pulls."""
    if not isinstance(form, OwnContact):
        return form.spring_n_m == form.damper_n_s_m == 0.0 and not any(form.force)
    touching, parted = form.touching, form.parted
    spring = tuple(touching.spring_n_m * place for place in form.reach)
    no_force = parted.spring_n_m == parted.damper_n_s_m == 0.0 and not any(parted.force)
    return no_force and touching.damper_n_s_m == 0.0 and touching.force == spring


class _Terms(NamedTuple):
    """The force of all terms in a mode, k δ + g δ' + own x, where own x' = drift x + gain δ'."""

    spring_n_m: float
    damper_n_s_m: float
    gain_n_m: float
    own: Array
    drift: Array
    forms: list[tuple[slice, LinearForm]]
    """The places of each term's states, and its form in this mode."""
    guards: list[Array]
    """For each contact of the terms' own, the row that is not negative while it is as in this mode."""


def _terms(layout: Layout, contacts: int, compression: Array) -> _Terms:
    spring = damper = gain = 0.0
    own, drift = layout.row(), layout.row()
    forms: list[tuple[slice, LinearForm]] = []
    guards: list[Array] = []
    for place, form in zip(layout.places, layout.scene.forms, strict=True):
        if isinstance(form, OwnContact):
            closed = contacts >> len(guards) & 1
            penetration = layout.compression
            penetration[place] = form.reach
            guards.append(penetration if closed else -penetration)
            form = form.touching if closed else form.parted
        forms.append((place, form))
        spring += form.spring_n_m
        damper += form.damper_n_s_m
        if form.rates:
            force = np.array(form.force)
            own[place] += force
            drift[place] = force @ np.array(form.rates)
            drift += float(force @ np.array(form.by_compression)) * compression
            gain += float(force @ np.array(form.by_speed))
    return _Terms(spring, damper, gain, own, drift, forms, guards)


class _Balance(NamedTuple):
    """What the equations of force determine."""

    rate: Array
    """The row of δ'."""
    pad_rate: Array
    """The row of p'."""
    reset: tuple[Array, Array]
    """The rows of δ and p as the mode is entered."""


def _pads(layout: Layout) -> tuple[float, float, float]:
    """Return damper and Maxwell branch of the pads; the time constant is 1 s where there are none."""
    pads = layout.scene.pads
    return (pads.damping_n_s_m, pads.branch_n_m, pads.branch_tau_s) if layout.pad_states else (0.0, 0.0, 1.0)


def _in_contact(layout: Layout, terms: _Terms, compression: Array, speed: Array) -> _Balance | None:
    closure, branch = layout.row(0), layout.branch
    if layout.rigid_pads:
        return _Balance(speed, layout.row(), (closure, layout.row()))
    pads_n_m = layout.scene.pads.stiffness_n_m
    damping, branch_n_m, tau = _pads(layout)
    if terms.damper_n_s_m + damping > 0.0:
        excess = (
            pads_n_m * (closure - compression)
            + damping * speed
            + branch
            - terms.spring_n_m * compression
            - terms.own
        )
        rate = excess / (terms.damper_n_s_m + damping)
        entered = layout.compression
    else:
        total = pads_n_m + branch_n_m + terms.spring_n_m + terms.gain_n_m
        if total <= 0.0 or pads_n_m + terms.spring_n_m <= 0.0:
            return None
        rate = ((pads_n_m + branch_n_m) * speed - branch / tau - terms.drift) / total
        entered = (pads_n_m * closure + branch - terms.own) / (pads_n_m + terms.spring_n_m)
    return _Balance(rate, speed - rate, (entered, closure - entered))


def _separated(layout: Layout, terms: _Terms, compression: Array) -> _Balance | None:
    spring, entered = terms.spring_n_m, layout.compression
    if terms.damper_n_s_m > 0.0:
        rate = -(spring * compression + terms.own) / terms.damper_n_s_m
    else:
        if spring + terms.gain_n_m > 0.0:
            rate = -terms.drift / (spring + terms.gain_n_m)
        elif spring == 0.0 and not terms.own.any():
            rate = layout.row()
        else:
            return None
        entered = -terms.own / spring if spring > 0.0 else layout.compression
    pads_n_m, (damping, branch_n_m, tau) = layout.scene.pads.stiffness_n_m, _pads(layout)
    pad_rate, pad_entered = layout.row(), layout.row()
    if damping > 0.0:
        pad_rate = -(pads_n_m * layout.pad + layout.branch) / damping
        pad_entered = layout.pad
    elif layout.pad_states:
        pad_rate = layout.branch / tau / (pads_n_m + branch_n_m)
        pad_entered = -layout.branch / pads_n_m
    return _Balance(rate, pad_rate, (entered, pad_entered))


def _add_state_rates(
    rates: Array, layout: Layout, terms: _Terms, balance: _Balance, compression: Array
) -> None:
    """Write the rows of δ', p', a', s' and e'."""
    if layout.separable:
        rates[2] = balance.rate
    if layout.pad_states:
        _, branch_n_m, tau = _pads(layout)
        rates[3] = balance.pad_rate
        rates[4] = branch_n_m * balance.pad_rate - layout.branch / tau
    for place, form in terms.forms:
        for k, row in enumerate(form.rates):
            rates[place.start + k, place] = row
            rates[place.start + k] += form.by_compression[k] * compression + form.by_speed[k] * balance.rate
    if layout.lags:
        commanded = layout.row(layout.n_states)
        rates[layout.n_states - 1] = (commanded - layout.effort) / layout.scene.lag_s


def _guards(layout: Layout, mode: tuple[bool, int, int], force: Array) -> tuple[list[Array], list[float]]:
    """Return the guards of separation and of the motion, and by how much they may be below 0."""
    compressed, motion, _ = mode
    guards: list[Array] = []
    tol: list[float] = []
    if layout.separable:
        guards.append(force if compressed else layout.compression + layout.pad - layout.row(0))
        tol.append(FORCE_TOL_N if compressed else GAP_TOL_M)
    if layout.has_friction and motion == STUCK:
        # Friction holds the fingers while it exceeds what pushes them, in either direction.
        limit = layout.friction + layout.scene.load_friction_coefficient * force
        guards += [limit - layout.effort + force, limit + layout.effort - force]
        tol += [FORCE_TOL_N, FORCE_TOL_N]
    elif layout.has_friction:
        guards += [layout.row(1) if motion == CLOSING else -layout.row(1), layout.row()]
        tol += [0.0, 0.0]
    return guards, tol
