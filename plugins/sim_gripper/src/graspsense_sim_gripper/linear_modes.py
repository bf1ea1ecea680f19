"""The modes of a piecewise linear scene: how each moves, what ends it, and the exact maps of pieces of a tick.

The state holds, in this order: closure D (object's width less the gap) and closing speed V; where the object can part
from the fingers its compression d; where the covers creep or damp their compression x and the creeping arm's force a;
the terms' states; the effort e, where the drive lags. Beside it stand the tick's effort u and the friction c.
With N the force on a pad and F the friction,

    m V' = e - N - b V - F,    F = +-(c + l N) while it slides, V' = V = 0 while it is stuck,
    N = k_s x + g_s x' + a,    a' = k_a x' - a / tau,    s' = A s + B d + C d',

and the object's terms balance N by d while it is pressed (x = D - d), and balance nothing while it is free. What has
no damper balances at once, and is differentiated: it then moves so that it stays in balance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.plant import Skin
from graspsense_sim_gripper.terms.term import LinearForm, OwnContact

HALVINGS: Final = 34
"""What ends a mode is located to a tick over two to this power: 6e-14 s of a millisecond."""
LOOK: Final = 0.5
"""Fastest natural frequency times the pieces in which it is looked for."""
RELAXING_LOOK: Final = 3
"""Halvings of a tick in which it is looked for where something relaxes within the tick."""
SAMPLES: Final = 6
"""Halvings of a tick at which the bound on what happens inside it is found."""
SAFETY: Final = 2.0
"""By which that bound is taken greater, for what lies between these."""
APART_M: Final = 1e-15
ROUNDING_N: Final = 1e-9
"""A distance and a force beyond zero that is rounding."""
TOGETHER: Final = 4
"""So many rows of a matrix are summed at once: side by side, they are one instruction to a processor."""
FORCE, RISING, GUARDS = range(3)
"""What is watched in a mode, in this order: the force on a pad, its rate, what ends the mode by falling below 0."""
STUCK, CLOSING, OPENING = range(3)


class Scene(NamedTuple):
    """What the maps follow from. Friction's constant part does not count: it stands beside the state."""

    mass_kg: float
    damping_n_s_m: float
    rubs: bool
    load_share: float
    lag_s: float
    skins_n_m: float
    skin: Skin
    forms: tuple[LinearForm | OwnContact, ...]


class Shape(NamedTuple):
    """How state, modes and rows are laid out: what the code that follows them is made for."""

    states: int
    columns: int
    parts: int
    """1: the object can part from the fingers, and its compression is a state."""
    creeps: int
    lags: int
    motions: int
    """3: stuck, closing, opening; 1: there is no friction to tell them apart."""
    contacts: int
    """Contacts of the terms' own."""
    ends: int
    """What may end a mode: one a term's own contact, one where the object parts, two of the motion where it rubs."""


class Modes(NamedTuple):
    """Of each mode, in a row: maps of a tick over two to the power of 0 to HALVINGS to the state and what is watched
    then, rows of what is watched now, bounds of changes within a tick, rows of d and x as the mode begins with them,
    and by how much what ends it may be below 0. Matrices lie column by column, `padded` with rows of zeros.
    """

    shape: Shape
    look: int
    """How often a tick is halved to look for what ends a mode."""
    maps: Any
    watched: Any
    simple: Any
    """Bounds in what each number of the state changes by; they are wider than the others."""
    ways: Any
    """Rows that tell a change of the state into what its motions do to it, each by itself, for the bounds."""
    bounds: Any
    begin: Any
    slack: Any


@lru_cache(maxsize=32)
def modes_of(scene: Scene, dt: float) -> Modes | None:
    """Return the modes of a scene with ticks of `dt`; None where one of them has no motion of its own."""
    layout = _Layout(scene)
    found = []
    for mode in layout.modes():
        one = _Mode.of(layout, mode)
        if one is None:
            return None
        found.append(one)
    rates = np.array([one.rates for one in found])
    n = layout.states
    swings = np.linalg.eigvals(rates[:, :n, :n])
    fastest = float(np.abs(swings.imag).max())
    look = max(0, math.ceil(math.log2(max(fastest * dt / LOOK, 1e-300))))
    if float(np.abs(swings.real).max()) * dt > LOOK:
        look = max(look, RELAXING_LOOK)
    look = min(look, HALVINGS)
    maps, integrals = _exponentials(rates, dt)
    watched = np.array([[one.force, one.force @ one.rates, *one.guards] for one in found])
    simple, ways, bounds = _bounds(rates[:, :n, :n], maps, integrals, watched, dt)
    shape = Shape(
        n,
        layout.columns,
        int(layout.parts),
        int(layout.creeps),
        int(layout.lags),
        layout.motions,
        layout.contacts,
        len(found[0].guards),
    )
    begin = np.array([one.begin for one in found])
    slack = np.array([one.slack for one in found])
    # What is watched then stands in the maps: a sum less to wait for.
    ahead = np.concatenate([maps[:, :, :n], watched[:, None] @ maps], axis=2)
    tables = (*(_by_columns(matrix) for matrix in (ahead, watched, simple, ways, bounds)), begin, slack)
    return Modes(shape, look, *(np.ascontiguousarray(table).ravel() for table in tables))


def padded(rows: int) -> int:
    """Return as how many rows these lie in a table."""
    return -(-rows // TOGETHER) * TOGETHER


def _by_columns(matrices: Any) -> Any:
    """Return matrices column by column, with rows of zeros added."""
    rows = matrices.shape[-2]
    wide = np.zeros((*matrices.shape[:-2], matrices.shape[-1], padded(rows)))
    wide[..., :rows] = np.swapaxes(matrices, -1, -2)
    return wide


@lru_cache(maxsize=32)
def listed(scene: Scene, dt: float) -> Modes | None:
    """Return the same in lists, which plain Python indexes more quickly."""
    modes = modes_of(scene, dt)
    if modes is None:
        return None
    return Modes(modes.shape, modes.look, *(numbers.tolist() for numbers in modes[2:]))


class _Layout:
    """Where everything stands in the state."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        rigid = scene.skins_n_m == math.inf
        self.parts = not (rigid and all(_only_pushes(form) for form in scene.forms))
        self.creeps = not rigid and (scene.skin.damping_n_s_m > 0.0 or scene.skin.arm_n_m > 0.0)
        self.lags = scene.lag_s > 0.0
        self.rubs = scene.rubs or scene.load_share > 0.0
        self.motions = 3 if self.rubs else 1
        self.contacts = sum(isinstance(form, OwnContact) for form in scene.forms)
        at = 2 + int(self.parts) + 2 * int(self.creeps)
        self.places = []
        for form in scene.forms:
            count = len((form.touching if isinstance(form, OwnContact) else form).rates)
            self.places.append(slice(at, at + count))
            at += count
        self.states = at + int(self.lags)
        self.columns = self.states + 1 + int(self.rubs)

    def row(self, *places: int) -> Any:
        """Return a row that picks these."""
        row = np.zeros(self.columns)
        row[list(places)] = 1.0
        return row

    @property
    def compression(self) -> Any:
        """Row of what the object is compressed by, as a state."""
        return self.row(2 if self.parts else 0)

    @property
    def cover(self) -> Any:
        return self.row(3) if self.creeps else self.row()

    @property
    def arm(self) -> Any:
        return self.row(4) if self.creeps else self.row()

    @property
    def effort(self) -> Any:
        return self.row(self.states - 1 if self.lags else self.states)

    @property
    def friction(self) -> Any:
        return self.row(self.states + 1) if self.rubs else self.row()

    def modes(self) -> Iterator[tuple[bool, int, int]]:
        """Yield pressed or not, motion, and which contacts of the terms' own touch, a bit each."""
        pressed = (False, True) if self.parts else (True,)
        motions = (STUCK, CLOSING, OPENING) if self.rubs else (CLOSING,)
        return product(pressed, motions, range(1 << self.contacts))


def _only_pushes(form: LinearForm | OwnContact) -> bool:
    """Return whether the force is that of a contact spring, so that it never pulls."""
    if not isinstance(form, OwnContact):
        return form.spring_n_m == form.damper_n_s_m == 0.0 and not any(form.force)
    by, parted = form.touching, form.parted
    spring = tuple(by.spring_n_m * place for place in form.reach)
    alone = parted.spring_n_m == parted.damper_n_s_m == 0.0 and not any(parted.force)
    return alone and by.damper_n_s_m == 0.0 and by.force == spring


class _Mode(NamedTuple):
    rates: Any
    force: Any
    begin: Any
    guards: Any
    slack: list[float]

    @classmethod
    def of(cls, layout: _Layout, mode: tuple[bool, int, int]) -> _Mode | None:
        """Return how this mode moves, by the balances above; None where they leave that undecided."""
        pressed, motion, touching = mode
        scene, row = layout.scene, layout.row
        rigid = scene.skins_n_m == math.inf
        skins = 0.0 if rigid else scene.skins_n_m
        skin_damping, arm_n_m, tau = scene.skin if layout.creeps else (0.0, 0.0, 1.0)
        closure, speed, effort = row(0), row(1) if motion != STUCK else row(), layout.effort
        d = closure if pressed and rigid else layout.compression
        arm = layout.arm
        # The terms together: force spring d + damper d' + own, own changing by `drift` and `grows` d' by itself.
        spring, damper, grows = 0.0, 0.0, 0.0
        own, drift = row(), row()
        places: list[tuple[slice, LinearForm]] = []
        guards: list[Any] = []
        slack: list[float] = []
        bit = 0
        for place, form in zip(layout.places, scene.forms, strict=True):
            if isinstance(form, OwnContact):
                touches = touching >> bit & 1
                bit += 1
                apart = layout.compression
                apart[place] = form.reach
                guards.append(apart if touches else -apart)
                slack.append(APART_M)
                form = form.touching if touches else form.parted
            places.append((place, form))
            spring += form.spring_n_m
            damper += form.damper_n_s_m
            if form.rates:
                force = np.array(form.force)
                own[place] += force
                drift[place] = force @ np.array(form.rates)
                drift += float(force @ np.array(form.by_compression)) * d
                grows += float(force @ np.array(form.by_speed))

        moves: Any
        begin = row(), row()
        if pressed and rigid:
            moves = speed
            begin = closure, row()
        elif pressed:
            if damper + skin_damping > 0.0:
                pushed = skins * (closure - d) + skin_damping * speed + arm - spring * d - own
                moves = pushed / (damper + skin_damping)
                entered = layout.compression
            else:
                total = skins + arm_n_m + spring + grows
                if total <= 0.0 or skins + spring <= 0.0:
                    return None
                moves = ((skins + arm_n_m) * speed - arm / tau - drift) / total
                entered = (skins * closure + arm - own) / (skins + spring)
            begin = entered, closure - entered
        elif damper > 0.0:
            moves = -(spring * d + own) / damper
            begin = layout.compression, row()
        else:
            if spring + grows > 0.0:
                moves = -drift / (spring + grows)
            elif spring == 0.0 and not own.any():
                moves = row()
            else:
                return None
            begin = -own / spring if spring > 0.0 else layout.compression, row()

        # The covers, pressed and free.
        if pressed:
            gives = speed - moves
        elif skin_damping > 0.0:
            gives = -(skins * layout.cover + arm) / skin_damping
            begin = begin[0], layout.cover
        elif layout.creeps:
            gives = arm / tau / (skins + arm_n_m)
            begin = begin[0], -arm / skins
        else:
            gives = row()
        felt = row()
        if pressed:
            # Of two forces that are the same, the one of the softer spring has less rounding.
            felt = spring * d + damper * moves + own
            if not rigid and skins < spring + grows and skin_damping == 0.0:
                felt = skins * (closure - d) + arm

        rates = np.zeros((layout.columns, layout.columns))
        rates[0] = speed
        if motion != STUCK:
            way = 0.0 if not layout.rubs else 1.0 if motion == CLOSING else -1.0
            rubbed = way * (layout.friction + scene.load_share * felt)
            rates[1] = (effort - felt - rubbed - scene.damping_n_s_m * speed) / scene.mass_kg
        if layout.parts:
            rates[2] = moves
        if layout.creeps:
            rates[3] = gives
            rates[4] = arm_n_m * gives - arm / tau
        for place, form in places:
            for k, own_rates in enumerate(form.rates):
                rates[place.start + k, place] = own_rates
                rates[place.start + k] += form.by_compression[k] * d + form.by_speed[k] * moves
        if layout.lags:
            asked = row(layout.states)
            rates[layout.states - 1] = (asked - effort) / scene.lag_s

        if layout.parts:
            guards.append(felt if pressed else layout.compression + layout.cover - closure)
            slack.append(ROUNDING_N if pressed else APART_M)
        if layout.rubs and motion == STUCK:
            holds = layout.friction + scene.load_share * felt
            guards += [holds - effort + felt, holds + effort - felt]
            slack += [ROUNDING_N, ROUNDING_N]
        elif layout.rubs:
            guards += [row(1) if motion == CLOSING else -row(1), row()]
            slack += [0.0, 0.0]
        watched = np.array(guards) if guards else np.zeros((0, layout.columns))
        return cls(rates, felt, np.array(begin), watched, slack)


def _exponentials(rates: Any, dt: float) -> tuple[Any, Any]:
    """Return exp(rates h) and its integral from 0 to h, for h a tick over two to the power of 0 to HALVINGS.

    Taylor's series of a matrix halved until it is small, squared up again.
    """
    size = rates.shape[-1]
    norm = float(np.abs(rates).sum(axis=-1).max()) * math.ldexp(dt, -HALVINGS)
    more = max(0, math.ceil(math.log2(max(norm, 1e-300))) + 3)
    h = math.ldexp(dt, -HALVINGS - more)
    small = rates * h
    eye = np.eye(size)
    # Of the exponential less one, so that nothing small is lost beside the one.
    term, less_one, integral = np.broadcast_to(eye, rates.shape), np.zeros_like(rates), h * eye
    for k in range(1, 14):
        term = term @ small / k
        less_one = less_one + term
        integral = integral + h / (k + 1) * term
    found = []
    for halvings in range(HALVINGS + more, -1, -1):
        if halvings <= HALVINGS:
            found.append((eye + less_one, integral))
        integral = 2.0 * integral + less_one @ integral
        less_one = 2.0 * less_one + less_one @ less_one
    maps, integrals = zip(*reversed(found), strict=True)
    return np.stack(maps, axis=1), np.stack(integrals, axis=1)


def _bounds(rates: Any, maps: Any, integrals: Any, watched: Any, dt: float) -> tuple[Any, Any, Any]:
    """Return simple bounds, ways and bounds: of what is watched, within a tick in which the state changes by c,

        |change| <= simple |c|    and    |change| <= bounds |ways c|.

    With r the rates at the start, the state changes by P(t) r, P the integral of the map: so by P(t) / P(dt) times c,
    looked at in pieces of a tick. The ways tell what is fast against the tick from what is slow: a slow motion of much
    together then counts for what it does, and not for what each part of it would do.
    """
    n = rates.shape[-1]
    step, so_far = maps[:, SAMPLES, :n, :n], integrals[:, SAMPLES, :n, :n][:, None]
    power = step
    for _ in range(SAMPLES):
        so_far = np.concatenate([so_far, so_far[:, -1:] + power[:, None] @ so_far], axis=1)
        power = power @ power
    ways = np.zeros((len(rates), 2 * n, n))
    simple = np.full((*watched.shape[:2], n), math.inf)
    bounds = np.full((*watched.shape[:2], 2 * n), math.inf)
    for mode, last in enumerate(integrals[:, 0, :n, :n]):
        slow, fast, along = _apart(rates[mode], dt)
        ways[mode, :n], ways[mode, n : n + len(fast)] = slow, fast
        try:
            shares = so_far[mode] @ np.linalg.inv(last)
        except np.linalg.LinAlgError:
            continue
        changes = np.einsum("gi,tij->tgj", watched[mode][:, :n], shares)
        for found, taken in ((simple, np.eye(n)), (bounds, np.concatenate([slow, along], axis=1))):
            most = SAFETY * np.abs(changes @ taken).max(axis=0)
            found[mode] = 0.0
            found[mode, :, : most.shape[1]] = np.where(np.isfinite(most), most, math.inf)
    return simple, ways, bounds


def _apart(rates: Any, dt: float) -> tuple[Any, Any, Any]:
    """Return what takes the slow part of a state, rows that take its fast parts, and the columns of those."""
    n = len(rates)
    sides = []
    for matrix in (rates, rates.T):
        values, vectors = np.linalg.eig(matrix)
        sides.append(
            [
                vector.real if value.imag >= 0.0 else vector.imag
                for value, vector in zip(values, vectors.T, strict=True)
                if abs(value) * dt > LOOK
            ]
        )
    along, across = (np.array(side).reshape(-1, n) for side in sides)
    try:
        fast = np.linalg.solve(across @ along.T, across)
    except np.linalg.LinAlgError:
        fast = np.full((0, n), math.nan)
    slow = np.eye(n) - along.T[:, : len(fast)] @ fast
    if len(along) != len(across) or not np.isfinite(slow).all():
        return np.eye(n), np.zeros((0, n)), np.zeros((n, 0))
    return slow, fast, along.T[:, : len(fast)]
