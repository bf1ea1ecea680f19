"""Where a scene is piecewise linear: exact maps over a tick, one a mode, and what ends a mode located inside the tick.

A straight drive, with Coulomb friction or none, on an object of linear terms is linear as long as it is free or
pressed, slides one way or is stuck, and the terms' own contacts touch or are parted. Its motion over a piece of a tick
is then a matrix, whatever the stiffness (exponential integration, as for stiff contacts in Del Prete et al., consim).
The matrices of a tick and of its halves, quarters and so on are made once a scene (`linear_scene`, `linear_modes`). A
tick in which nothing can happen, by a bound on what changes inside it, is one of them; where something may, it is
looked for with pieces short against the fastest swing, and then between them by halving. What is no such motion (ends
of travel, but for standing wide open; an object that is pushed across its table) is left to the plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import bind
from graspsense_sim_gripper.dynamics.state import Contact, ContactState, Motion, PlantState, StepState
from graspsense_sim_gripper.linear_modes import (
    APART_M,
    FORCE,
    GUARDS,
    HALVINGS,
    RISING,
    TOGETHER,
    Shape,
    padded,
)
from graspsense_sim_gripper.plant import (
    IN_SHAPE_M,
    PlantParams,
)
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import NO_STATE

MOST_NUMBERS: Final = 0x3FFFFFFF
WHOLE: Final = 1 << HALVINGS
MOST_EVENTS: Final = 64
"""A tick in which more modes end than this is taken on without looking."""
PLACES: Final = ("NOW", "THEN", "WAS", "MOST", "BY")
"""What a tick's room is for: the state before and after a piece of the tick, what is watched before it, and bounds."""
PEAK_SHARE: Final = 2e-3
"""A swing inside a tick that goes beyond the greatest force by less than this share of it may be missed."""


class Linear(NamedTuple):
    """A plant with its modes, and room for what a tick works on."""

    plant: PlantParams
    look: int
    """How often a tick is halved to look for what ends a mode."""
    maps: Any
    watched: Any
    simple: Any
    ways: Any
    bounds: Any
    begin: Any
    slack: Any
    room: Any
    """The state before a piece of a tick; state and what is watched after it; what is watched before it; bounds.

    In one table at places known beforehand: compiled code then need not ask whether two of them are one, and keeps
    most of it in registers.
    """


# --------------------------------------------------------------- the terms' states, into the maps' state and back


def numbers_of(state: Any) -> int:
    """Return how many numbers of the maps' state a term's own state is."""
    return len(state) if all(isinstance(one, float) for one in state) and len(state) <= 4 else 0


def _put0(state: Any, now: Any, at: int) -> int:
    return at


def _put1(state: Any, now: Any, at: int) -> int:
    now[at] = state[0]
    return at + 1


def _put2(state: Any, now: Any, at: int) -> int:
    now[at], now[at + 1] = state[0], state[1]
    return at + 2


def _put3(state: Any, now: Any, at: int) -> int:
    now[at], now[at + 1], now[at + 2] = state[0], state[1], state[2]
    return at + 3


def _put4(state: Any, now: Any, at: int) -> int:
    now[at], now[at + 1], now[at + 2], now[at + 3] = state[0], state[1], state[2], state[3]
    return at + 4


made: Any = tuple


def _take0(state: Any, now: Any, at: int) -> tuple[Any, int]:
    return state, at


def _take1(state: Any, now: Any, at: int) -> tuple[Any, int]:
    return made(now[at]), at + 1


def _take2(state: Any, now: Any, at: int) -> tuple[Any, int]:
    return made(now[at], now[at + 1]), at + 2


def _take3(state: Any, now: Any, at: int) -> tuple[Any, int]:
    return made(now[at], now[at + 1], now[at + 2]), at + 3


def _take4(state: Any, now: Any, at: int) -> tuple[Any, int]:
    return made(now[at], now[at + 1], now[at + 2], now[at + 3]), at + 4


PUT: Final = (_put0, _put1, _put2, _put3, _put4)
TAKE: Final = (_take0, _take1, _take2, _take3, _take4)
put: Any = _put0
take: Any = _take0


def _put_none(terms: Any, states: Any, now: Any, at: int) -> int:
    return at


def _take_none(terms: Any, states: Any, now: Any, at: int) -> tuple[Any, int]:
    return (), at


put_rest: Any = _put_none
take_rest: Any = _take_none


def _put_all(terms: Any, states: Any, now: Any, at: int) -> int:
    if terms[0].kept == 1:
        at = put(states[0], now, at)
    return put_rest(terms[1:], states[1:], now, at)  # type: ignore[no-any-return]


def _take_all(terms: Any, states: Any, now: Any, at: int) -> tuple[Any, int]:
    state = states[0]
    if terms[0].kept == 1:
        state, at = take(states[0], now, at)
    others, at = take_rest(terms[1:], states[1:], now, at)
    return (state, *others), at


def move_of(
    kinds: Sequence[str], shape: Shape, plant_move: Callable[..., PlantState], **tuples: Any
) -> Callable[[Any, PlantState, float, float], PlantState]:
    """Return `move` for an object of these terms and maps of this shape; it leaves to `plant_move` the rest.

    The shape's numbers are parts of the code: loops over three or four of them then are none.
    """
    puts: Any = _put_none
    takes: Any = _take_none
    for state in reversed((NO_STATE, *(find_term(kind)[1].at_rest for kind in kinds))):
        count = numbers_of(state)
        puts = bind(_put_all, put=PUT[count], put_rest=puts)
        takes = bind(_take_all, take=bind(TAKE[count], made=type(state)), take_rest=takes)
    laid_out = {name.upper(): number for name, number in shape._asdict().items()}
    places = {name: k * _room(shape) for k, name in enumerate(PLACES)}
    now, then, was, most, by = places.values()
    watched = padded(GUARDS + shape.ends)
    mapped, parted = padded(shape.states + GUARDS + shape.ends), padded(2 * shape.states)
    modes = ((shape.parts + 1) * shape.motions) << shape.contacts
    here = {"MODES": modes, "WATCHED": watched, "MAPPED": mapped, "PARTED": parted, **laid_out, **places}
    changes = {"COLUMNS": shape.states, "FROM": then, "CHANGES": 1, "NOW": now}
    products = {
        "_moved": bind(_product, ROWS=mapped, COLUMNS=shape.columns, FROM=now, TO=then),
        "_seen": bind(_product, ROWS=watched, COLUMNS=shape.columns, FROM=now, TO=was),
    }
    swings = bind(
        _swings,
        _simply=bind(_product, ROWS=watched, TO=most, SIZES=1, **changes),
        _parted=bind(_product, ROWS=parted, TO=by, **changes),
        _bounded=bind(_product, ROWS=watched, COLUMNS=2 * shape.states, FROM=by, TO=most, SIZES=1),
        **here,
    )
    taken = bind(
        _taken,
        put_states=puts,
        take_states=takes,
        _quiet=bind(_quiet, _swings=swings, **products, **here),
        _searched=bind(_searched, _swings=swings, _row=bind(_row, **here), **products, **here),
        **here,
        **tuples,
    )
    return bind(move, plant_move=plant_move, _taken=taken)


def seldom(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return what a part of `move` seldom calls: compiled code keeps the call, and the registers for the rest."""
    code = function.__code__
    if code is move.__code__:
        return ("plant_move",)
    return ("_searched",) if code is _taken.__code__ else ()


def room_of(shape: Shape) -> int:
    """Return of how many numbers a tick's room is made."""
    return len(PLACES) * _room(shape)


def _room(shape: Shape) -> int:
    """Return how many numbers there are at each of the places of a tick's room."""
    return padded(max(shape.columns, shape.states + GUARDS + shape.ends, 2 * shape.states))


# ---------------------------------------------------------------------------------------------------- a tick


def _no_plant(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    raise TypeError("there is no plant to leave a tick to: move_of(kinds, plant_of(laws))")


plant_move: Any = _no_plant
put_states: Any = _put_none
take_states: Any = _take_none
STATES = COLUMNS = PARTS = CREEPS = LAGS = MOTIONS = CONTACTS = ENDS = MODES = ROWS = 0
WATCHED = MAPPED = PARTED = 0
"""Rows of the tables of what is watched, of the maps, and of the ways, with those that pad them."""
NOW = THEN = WAS = MOST = BY = FROM = TO = 0
CHANGES = SIZES = 0
"""1: a product of how the state changes; of how much what is multiplied is, whichever way."""


def _product(table: Any, at: int, room: Any) -> None:
    """Write the matrix that begins at this place of the table, times what is at `FROM`, to `TO`."""
    # Known not to be negative, which compiled code else asks at each number.
    at &= MOST_NUMBERS
    for group in range(ROWS // TOGETHER):
        i = group * TOGETHER
        first = second = third = fourth = 0.0
        for j in range(COLUMNS):
            k, by = at + j * ROWS + i, room[FROM + j]
            if CHANGES == 1:
                by -= room[NOW + j]
            if SIZES == 1:
                by = abs(by)
            first += table[k] * by
            second += table[k + 1] * by
            third += table[k + 2] * by
            fourth += table[k + 3] * by
        i += TO
        room[i], room[i + 1], room[i + 2], room[i + 3] = first, second, third, fourth


_moved = _seen = _simply = _parted = _bounded = _product


def _row(rows: Any, at: int, room: Any) -> float:
    at &= MOST_NUMBERS
    found = 0.0
    for j in range(COLUMNS):
        found += rows[at + j] * room[NOW + j]
    return found


def _top(before: float, rising: float, after: float, falling: float, h: float) -> float:
    """Return the greatest force of a piece at whose ends it and its rate are these, by the cubic through them."""
    step = after - before
    m0, m1 = rising * h, falling * h
    a, b = 3.0 * (m0 + m1 - 2.0 * step), 2.0 * (3.0 * step - 2.0 * m0 - m1)
    s = 2.0 * m0 / (math.sqrt(max(b * b - 4.0 * a * m0, 0.0)) - b)
    # What bends one way lies below its tangents.
    most = min(before + m0, after - m1)
    return min(before + s * (m0 + s * (3.0 * step - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * step))), most)


def _quiet(
    params: Linear,
    mode: int,
    standing: bool,
    top: float,
    dt: float,
) -> bool:
    """Return whether nothing can end this mode within a tick, and write what the tick comes to.

    As for most ticks; it is also not quiet where the force may have been greater inside it than at its ends. Which of
    the terms' own contacts touch in the mode is guessed, and put right first.
    """
    look, room, slack = params.look, params.room, params.slack
    allowed = 0
    for _ in range(2):
        allowed = (mode * ENDS) & MOST_NUMBERS
        _seen(params.watched, mode * WATCHED * COLUMNS, room)
        wrong = 0
        for k in range(CONTACTS):
            if room[WAS + GUARDS + k] < -slack[allowed + k]:
                wrong += 1 << k
        if wrong == 0:
            break
        mode ^= wrong
    if MOTIONS == 3 and standing:
        for k in range(ENDS - 2, ENDS):
            if room[WAS + GUARDS + k] < -slack[allowed + k]:
                return False
    _moved(params.maps, mode * (HALVINGS + 1) * MAPPED * COLUMNS, room)
    for k in range(ENDS):
        if room[THEN + STATES + GUARDS + k] < -slack[allowed + k]:
            return False
    if look == 0:
        return not (room[WAS + RISING] > 0.0 > room[THEN + STATES + RISING])
    return not _swings(params, mode, top, dt)


def _swings(params: Linear, mode: int, top: float, dt: float) -> bool:
    """Return whether the mode may have ended inside a tick that it lasts by its end, or the force gone beyond `top`."""
    room = params.room
    _simply(params.simple, mode * WATCHED * STATES, room)
    beyond = (1.0 + PEAK_SHARE) * max(top, room[THEN + STATES + FORCE])
    may = not room[WAS + FORCE] + room[MOST + FORCE] <= beyond
    for k in range(ENDS):
        if not room[MOST + GUARDS + k] <= room[WAS + GUARDS + k]:
            may = True
    if not may:
        return False
    _parted(params.ways, mode * PARTED * STATES, room)
    _bounded(params.bounds, 2 * mode * WATCHED * STATES, room)
    for k in range(ENDS):
        if not room[MOST + GUARDS + k] <= room[WAS + GUARDS + k]:
            return True
    if room[WAS + FORCE] + room[MOST + FORCE] <= beyond:
        return False
    # Where it rises as evenly as its ends say there is no swing inside, either.
    rise = room[THEN + STATES + FORCE] - room[WAS + FORCE]
    uneven = max(abs(room[WAS + RISING] * dt - rise), abs(room[THEN + STATES + RISING] * dt - rise))
    return not max(room[WAS + FORCE], room[THEN + STATES + FORCE]) + uneven <= beyond


def _searched(
    params: Linear,
    pressed: int,
    motion: int,
    touching: int,
    standing: bool,
    touched: int,
    top: float,
    dt: float,
) -> tuple[int, int, float, int]:
    """Take a tick in which modes may end, in pieces; return pressed, touched and the peak then, and how many ended."""
    look, room = params.look, params.room
    maps, watched, begin, slack = params.maps, params.watched, params.begin, params.slack
    mode = allowed = 0
    left, least, events, until = WHOLE, 0, 0, 0
    begins = True
    while left > 0:
        while begins:
            begins = False
            mode = ((pressed * PARTS * MOTIONS + motion) << CONTACTS) + touching
            allowed = (mode * ENDS) & MOST_NUMBERS
            _seen(watched, mode * WATCHED * COLUMNS, room)
            if events == 0:
                for k in range(CONTACTS):
                    if room[WAS + GUARDS + k] < -slack[allowed + k]:
                        touching ^= 1 << k
                        begins = True
            if MOTIONS == 3 and standing and not begins:
                # What stands is stuck, unless what holds it less what closes it, or less what opens it, says otherwise.
                standing = False
                if room[WAS + GUARDS + ENDS - 2] < -slack[allowed + ENDS - 2]:
                    motion, begins = 1, True
                elif room[WAS + GUARDS + ENDS - 1] < -slack[allowed + ENDS - 1]:
                    motion, begins = 2, True
        while (WHOLE >> least) > left:
            least += 1
        _moved(maps, (mode * (HALVINGS + 1) + least) * MAPPED * COLUMNS, room)
        ends = False
        for k in range(ENDS):
            if room[THEN + STATES + GUARDS + k] < -slack[allowed + k]:
                ends = True
        if events >= MOST_EVENTS:
            ends = False
        elif least == 0 and look > 0 and (ends or _swings(params, mode, top, dt)):
            least = look
            continue
        if ends and least < HALVINGS:
            until = left - (WHOLE >> least)
            least += 1
            continue
        if room[THEN + STATES + FORCE] > top:
            top = room[THEN + STATES + FORCE]
        if room[WAS + RISING] > 0.0 and room[THEN + STATES + RISING] < 0.0 and least >= look:
            h = math.ldexp(dt, -least)
            after = room[THEN + STATES + FORCE]
            top = max(
                top, _top(room[WAS + FORCE], room[WAS + RISING], after, room[THEN + STATES + RISING], h)
            )
        left -= WHOLE >> least
        for j in range(STATES):
            room[NOW + j] = room[THEN + j]
        if ends:
            events += 1
            least = look
            begins = True
            parted = False
            for k in range(ENDS):
                if room[THEN + STATES + GUARDS + k] < -slack[allowed + k]:
                    if k < CONTACTS:
                        touching ^= 1 << k
                    elif PARTS == 1 and k == CONTACTS:
                        parted = True
                    else:
                        # What slid stands, for now; what was stuck does, too.
                        room[NOW + 1] = 0.0
                        standing, motion = True, 0
            if parted:
                pressed = 1 - pressed
                at = 2 * (((pressed * MOTIONS + motion) << CONTACTS) + touching) * COLUMNS
                cover = _row(begin, at + COLUMNS, room)
                room[NOW + 2] = _row(begin, at, room)
                if CREEPS == 1:
                    room[NOW + 3] = cover
                if pressed == 1:
                    touched = 1
        elif left > 0:
            for j in range(GUARDS + ENDS):
                room[WAS + j] = room[THEN + STATES + j]
            if least > look and events < MOST_EVENTS:
                # What was seen to happen lies in the second half of what was looked at.
                least = min(least + 1, HALVINGS) if left > until else look
    for j in range(STATES):
        room[THEN + j] = room[NOW + j]
    return pressed, touched, top, events


def move(params: Linear, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt`, the tick that the maps are for, in which this effort was asked for."""
    done, after = _taken(params, state, effort_n, dt)
    if not done:
        return plant_move(params.plant, state, effort_n, dt)  # type: ignore[no-any-return]
    return after


def _taken(params: Linear, state: PlantState, effort_n: float, dt: float) -> tuple[bool, PlantState]:
    """Return whether the maps can take this tick, and the plant after it."""
    plant, room = params.plant, params.room
    (revolutions, speed, gap, rate), contact, (step, n, lost), given, peak = state
    felt_left, felt_right, offset, touched, squeezed, other, alone = contact
    drive, thing = plant.drive, plant.thing
    # Opened as far as it goes it stands, whatever opens it further, and what it let go comes back to its shape.
    opened = revolutions >= drive.open_rev and effort_n <= 0.0
    if (
        (opened and (LAGS == 1 or speed != 0.0 or squeezed.force_n > 0.0))
        or offset != 0.0
        or felt_left != felt_right
        # What the plant has yet to bring up to date is the plant's.
        or alone > 0.0
    ):
        return False, state

    closure = thing.width_m - gap
    room[NOW] = closure
    room[NOW + 1] = -speed * rate
    at = 2
    pressed = 1
    d = cover = 0.0
    if PARTS == 1:
        d = squeezed.compression_m
        if CREEPS == 1:
            cover = squeezed.pad_m
            room[NOW + 3], room[NOW + 4] = cover, squeezed.branch_n
            at = 5
        else:
            at = 3
        if squeezed.force_n <= 0.0 and closure - d - cover < -APART_M:
            pressed = 0
        elif thing.skins_n_m == math.inf:
            d = closure
        room[NOW + 2] = d
    own = at
    at = put_states(thing.terms, squeezed.states, room, NOW + own)
    room[NOW + STATES] = 0.0 if opened else effort_n
    if LAGS == 1:
        room[at] = given
    motion = 0
    standing = room[NOW + 1] == 0.0
    if MOTIONS == 3:
        room[NOW + STATES + 1] = drive.coulomb_n
        if not standing:
            motion = 1 if room[NOW + 1] > 0.0 else 2
    # A guess: see `_quiet` and `_searched`.
    touching = (1 << CONTACTS) - 1 if squeezed.force_n > 0.0 else 0
    top, events = peak, 0
    mode = ((pressed * PARTS * MOTIONS + motion) << CONTACTS) + touching
    if _quiet(params, mode, standing, top, dt):
        top = max(top, room[THEN + STATES + FORCE])
    else:
        pressed, touched, top, events = _searched(
            params, pressed, motion, touching, standing, touched, top, dt
        )

    came = room[THEN] - closure
    gap1 = gap - came
    # The state waits for this, and a product comes sooner than a quotient.
    turns = 1.0 / rate
    revolutions1 = revolutions - came * turns
    if not (drive.closed_rev < revolutions1 < drive.open_rev or (opened and came == 0.0)):
        return False, state
    # A mode that begins at the very end of the tick has yet to act.
    force = max(room[THEN + STATES + FORCE], 0.0) if pressed == 1 else 0.0
    cover, arm = squeezed.pad_m, squeezed.branch_n
    if CREEPS == 1:
        cover, arm = room[THEN + 3], room[THEN + 4]
    if PARTS == 1:
        d = room[THEN + 2]
        if pressed == 1:
            touched = 1
        elif room[THEN] < 0.0 and abs(d) + abs(cover) <= IN_SHAPE_M and (not opened or thing.swings == 0):
            touched = 0
    else:
        if room[THEN] >= 0.0:
            touched = 1
        d = room[THEN] if touched == 1 else 0.0
    if LAGS == 1:
        given = room[THEN + STATES - 1]
    after_states, _ = take_states(thing.terms, squeezed.states, room, THEN + own)
    felt = ContactState(d, force, squeezed.slope_n_m, after_states, cover, arm, squeezed.rate_m_s, math.inf)
    if thing.held == 1:
        # Centred: the other half does the same.
        other = felt
    return True, PlantState(
        Motion(revolutions1, -room[THEN + 1] * turns, gap1, rate),
        Contact(force, force, offset, touched, felt, other, 0.0),
        StepState(step, n + 1, lost + (1 if events >= MOST_EVENTS else 0)),
        given,
        top,
    )
