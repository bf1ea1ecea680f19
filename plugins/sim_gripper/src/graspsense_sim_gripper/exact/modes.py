"""The modes of a piecewise-linear scene and their matrices.

A mode is a combination of contact (free, compressed), motion (stuck, closing, opening) and the states of the terms' own
contacts (closed, open). Within a mode the scene is the linear system

    x' = A x + B u,        x = (D, V, δ, p, a, s, e),        u = (E, c)

    D  closure (m): width of the object minus the gap
    V  closing speed (m/s): the rate of D
    δ  compression of the object (m); a state if the object can separate from the pads
    p  compression of both pads together (m); a state if they damp or creep
    a  force of the pads' Maxwell branch (N); a state if p is
    s  states of the terms
    e  effort of the drive (N); a state if the drive lags
    E  commanded effort (N), constant over the tick
    c  Coulomb friction (N), the constant part of friction; an input if the drive has friction

With the force N on a pad, friction F, mass m, damping b, load friction coefficient μ and drive lag T, the equations of
motion are

    D' = V,    m V' = e - N - b V - F,    F = ±(c + μ N) while sliding,    V = V' = 0 while stuck,
    e' = (E - e) / T.

The pads and the object both carry N. The pads have the spring k_p, the damper g_p and a Maxwell branch k_a, τ:

    N = k_p p + g_p p' + a,        a' = k_a p' - a / τ,                     (pads)
    N = k δ + g δ' + f·s,          s' = A_s s + b_s δ + c_s δ',             (all terms together)

In contact p = D - δ, and the equality of both forces determines δ'. Without contact both forces are 0, which determines
δ' and p'. A balance that contains no damper contains neither rate; it is differentiated with respect to time.

Source: docs/numerics.md, sections "Equations of motion", "Contact" and "Exact discretisation".
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
"""Indices of the outputs of a mode: force on a pad (N), its rate (N/s), and the first guard. A mode ends if one of its
guards becomes negative."""
GAP_TOL_M: Final = 1e-15
FORCE_TOL_N: Final = 1e-9
"""A guard that is negative by less than this counts as 0: the difference is rounding."""


class LinearScene(NamedTuple):
    """The parameters of the modes. Coulomb friction is an input, and therefore not among them."""

    mass_kg: float
    damping_n_s_m: float
    has_friction: bool
    load_friction_coefficient: float
    lag_s: float
    pads: PadCompliance
    forms: tuple[LinearForm | OwnContact, ...]
    """The linear form of each term."""


class Shape(NamedTuple):
    """The numbers of states, modes and outputs, for which the code of `propagate` is specialised."""

    n_states: int
    n_columns: int
    """Number of states and inputs."""
    separable: int
    """1: the object can separate from the pads, and its compression is a state."""
    pad_states: int
    """1: the pads damp or creep; their compression and the force of their Maxwell branch are states."""
    lags: int
    """1: the effort of the drive is a state."""
    n_motions: int
    """3: stuck, closing, opening; 1: without friction these do not differ."""
    n_contacts: int
    """Number of terms with a contact of their own."""
    n_guards: int
    """One for each contact of a term, one if the object is separable, and two for the motion if there is friction."""


class ModeMatrices(NamedTuple):
    """The matrices of one mode. A row has n_columns coefficients: the states and then the inputs."""

    rates: Array
    """A and B side by side, above rows of zeros for the inputs: shape (n_columns, n_columns)."""
    force: Array
    """The row that gives the force on a pad."""
    reset: Array
    """Two rows: δ and p immediately after contact or separation has led to this mode."""
    guards: Array
    """The row of each guard, shape (n_guards, n_columns). A guard is not negative while the mode lasts."""
    guard_tol: list[float]
    """By how much each guard may be negative (m, N or m/s, as the guard)."""


class Layout:
    """The indices of the states and inputs in (x, u), and rows that select them."""

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
        """The numbers of states, modes and outputs."""
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
        """Return the row with ones at these indices and zeros elsewhere."""
        row = np.zeros(self.n_columns)
        row[list(places)] = 1.0
        return row

    @property
    def compression(self) -> Array:
        """The row of δ; the row of D if δ is not a state."""
        return self.row(2 if self.separable else 0)

    @property
    def pad(self) -> Array:
        """The row of p; zeros if p is not a state."""
        return self.row(3) if self.pad_states else self.row()

    @property
    def branch(self) -> Array:
        """The row of a; zeros if a is not a state."""
        return self.row(4) if self.pad_states else self.row()

    @property
    def effort(self) -> Array:
        """The row of e; the row of E if the drive does not lag."""
        return self.row(self.n_states - 1 if self.lags else self.n_states)

    @property
    def friction(self) -> Array:
        """The row of c; zeros without friction."""
        return self.row(self.n_states + 1) if self.has_friction else self.row()

    def modes(self) -> Iterator[tuple[bool, int, int]]:
        """Return all modes: whether the object is compressed, the motion, and a bit for each closed contact of a term.

        Their order is that of `propagate._mode_index`.
        """
        compressed = (False, True) if self.separable else (True,)
        motions = (STUCK, CLOSING, OPENING) if self.has_friction else (CLOSING,)
        return product(compressed, motions, range(1 << self.n_contacts))


def mode_matrices(layout: Layout, mode: tuple[bool, int, int]) -> ModeMatrices | None:
    """Return the matrices of a mode; None if the balance of forces leaves δ' undetermined."""
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
        # Object and pads carry the same force: computed from the softer spring, it has the smaller rounding error.
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
    """Return whether a term never pulls: without force, or a spring on a contact of its own."""
    if not isinstance(form, OwnContact):
        return form.spring_n_m == form.damper_n_s_m == 0.0 and not any(form.force)
    touching, parted = form.touching, form.parted
    spring = tuple(touching.spring_n_m * place for place in form.reach)
    no_force = parted.spring_n_m == parted.damper_n_s_m == 0.0 and not any(parted.force)
    return no_force and touching.damper_n_s_m == 0.0 and touching.force == spring


class _Terms(NamedTuple):
    """The force of all terms in a mode, k δ + g δ' + own x. The rate of own x is drift x + gain δ'."""

    spring_n_m: float
    damper_n_s_m: float
    gain_n_m: float
    own: Array
    drift: Array
    forms: list[tuple[slice, LinearForm]]
    """The indices of each term's states, and its linear form in this mode."""
    guards: list[Array]
    """The guard of each contact of a term: not negative while the contact is closed, or open, as in this mode."""


def _terms(layout: Layout, contacts: int, compression: Array) -> _Terms:
    """Return the force of all terms; bit i of `contacts` says whether the i-th contact of a term is closed."""
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
    """What the balance of forces determines."""

    rate: Array
    """The row of δ'."""
    pad_rate: Array
    """The row of p'."""
    reset: tuple[Array, Array]
    """The rows of δ and p when the mode is entered."""


def _pads(layout: Layout) -> tuple[float, float, float]:
    """Return g_p, k_a and τ of the pads; 0, 0 and 1 s if the pads neither damp nor creep."""
    pads = layout.scene.pads
    return (pads.damping_n_s_m, pads.branch_n_m, pads.branch_tau_s) if layout.pad_states else (0.0, 0.0, 1.0)


def _in_contact(layout: Layout, terms: _Terms, compression: Array, speed: Array) -> _Balance | None:
    """Return the balance in contact, N of the pads = N of the object; None if it does not determine δ'."""
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
    """Return the balance without contact, where both forces are 0; None if it does not determine δ'."""
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
    """Return the guards of separation and of the motion, and by how much each may be negative."""
    compressed, motion, _ = mode
    guards: list[Array] = []
    tol: list[float] = []
    if layout.separable:
        guards.append(force if compressed else layout.compression + layout.pad - layout.row(0))
        tol.append(FORCE_TOL_N if compressed else GAP_TOL_M)
    if layout.has_friction and motion == STUCK:
        # Friction holds the fingers while it exceeds the driving force in either direction.
        limit = layout.friction + layout.scene.load_friction_coefficient * force
        guards += [limit - layout.effort + force, limit + layout.effort - force]
        tol += [FORCE_TOL_N, FORCE_TOL_N]
    elif layout.has_friction:
        guards += [layout.row(1) if motion == CLOSING else -layout.row(1), layout.row()]
        tol += [0.0, 0.0]
    return guards, tol
