"""What a scene needs at an accuracy: each term kept, replaced by its limit or dropped, and which scheme steps it.

The object is pressed along three paths by the laws of its own terms: closing as slowly as the fingers touch it, as fast
as the force it is to be squeezed with can drive them, and in the time that a squeeze may take; each then stands for as
long as a grasp does. What may be left out is what changes the force on those paths by little, measured against the
force itself. So decisions rest on rates and shares, never on names, and a term from elsewhere is judged as ours are.

How much that may be is a rung of a ladder, from bold to careful. Paths are no grasp: which rung holds is found by
grasping, see `checking`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

from attrs import asdict, evolve, frozen

from graspsense.plugin_api import bind
from graspsense_sim_gripper.dynamics.state import ContactState
from graspsense_sim_gripper.kernel import sum_of
from graspsense_sim_gripper.plant import EXPLICIT, MEAN_FORCE, STIFF, Steps, Thing, squeeze
from graspsense_sim_gripper.terms.registry import find_term, laws_of
from graspsense_sim_gripper.terms.remainder import Kept, Remainder
from graspsense_sim_gripper.terms.term import NO_STATE, WorkingPoint, no_rates

STEP_SHARE: Final = 0.34
"""A step's error is this share of the accuracy to the power of 1.5: as many steps then add up to a part of it."""


class Rung(NamedTuple):
    """How boldly a model is chosen."""

    name: str
    model_share: float
    """Part of the accuracy that leaving things out may change the force on the paths by; 0: every term is kept."""
    finer: float = 1.0
    """Steps are as for the accuracy over this."""
    least_steps: int = 1
    """Into how many steps a tick is cut at the least."""


BOLDEST: Final = Rung("boldest", 10.0)
BOLDER: Final = Rung("bolder", 3.0)
BOLD: Final = Rung("bold", 0.3)
CAREFUL: Final = Rung("careful", 0.05)
WHOLE: Final = Rung("every term", 0.0)
FINE: Final = Rung("every term, finer steps", 0.0, 10.0, 4)
FINEST: Final = Rung("every term, finest steps", 0.0, 100.0, 32)
LADDER: Final = (BOLDEST, BOLDER, BOLD, CAREFUL, WHOLE, FINE, FINEST)
FULL_LADDER: Final = (WHOLE, FINE, FINEST)
"""Where every term is wanted."""
GROWS: Final = 0.1
"""Accuracy from which on steps grow twofold after a touch."""
KEPT: Final = "kept"
DROPPED: Final = "dropped"
BEYOND: Final = 1.5
"""A choice holds up to this much over the force that was expected."""
STIFFEST_N_M: Final = 1e6
"""Peaks on contacts up to this stiff are held to their reference."""
HOLD_S: Final = 1.0
SQUEEZE_S: Final = 3.0
"""No squeeze takes longer: the controllers give up then."""
PIECES: Final = 24
TOO_MUCH: Final = 0.5
"""A change of the force beyond which no accuracy takes it."""
EARLY: Final = 3
LEAST_SPEED_M_S: Final = 1e-4
DEEPEST: Final = 0.9
"""No object is pressed further than to this share of its width."""
SCHEMES: Final = {EXPLICIT: "Verlet", STIFF: "TR-BDF2", MEAN_FORCE: "mean force"}


@frozen(kw_only=True)
class Decision:
    """What became of a term: kept, limit or dropped; the number that decided; the error it may cost."""

    term: str
    decision: str
    what: str
    number: float
    error: float


@frozen(kw_only=True)
class Check:
    """A grasp in the chosen model beside one in the full model with finer steps."""

    error: float
    quantity: str
    """Which of its errors was the greatest."""
    grasps: int
    """How many were made until a rung held."""


@frozen(kw_only=True)
class Choice:
    """The model of an object at an accuracy: what is kept of it, its steps, and why."""

    accuracy: float
    made: tuple[str, ...]
    """For each term `kept`, `dropped` or the name of its limit; then the same of the covers."""
    point: WorkingPoint
    steps: Steps
    decisions: tuple[Decision, ...]
    scheme: Decision
    contact: Decision
    """Whether the greatest force on a contact this stiff is resolved."""
    error: float
    """What leaving all of that out may cost."""
    swings: bool
    """Whether a term has a state that swings, or one of which it does not say how fast it is."""
    rung: str
    check: Check | None = None
    """What a trial grasp said of it; None where there was none."""

    def apply(self, thing: Thing, kinds: Sequence[str]) -> Thing:
        """Return an instance of the object as this choice simulates it."""
        for i, name in enumerate(self.made[:-1]):
            if name != KEPT:
                thing = _named(name, _without(thing, kinds, i, self.point))
        if self.made[-1] != KEPT:
            thing = _named(self.made[-1], _covers(thing))
        return thing._replace(swings=1 if self.swings else 0)

    @property
    def most_n(self) -> float:
        """Up to which force the choice holds."""
        return BEYOND * self.point.force_n

    def covers(self, peak_n: float) -> bool:
        """Return whether a grasp with this peak is one that the choice was made for."""
        return peak_n <= self.most_n or self.error == 0.0

    def by_maps(self) -> Choice:
        """Return the same choice where exact maps take the ticks of a scene that is linear as it is."""
        what = "all of it is linear between its modes"
        scheme = Decision(term="steps", decision="exact maps", what=what, number=0.0, error=0.0)
        return evolve(self, scheme=scheme)

    def plain(self) -> dict[str, Any]:
        """Return it as plain values, for a report."""
        return {
            "accuracy": self.accuracy,
            "rung": self.rung,
            "error": self.error,
            "expected_force_n": self.point.force_n,
            "expected_speed_m_s": self.point.speed_m_s,
            "checked": None if self.check is None else asdict(self.check),
            "decisions": [asdict(one) for one in (*self.decisions, self.scheme, self.contact)],
        }


def whole(terms: Sequence[Any]) -> tuple[Kept, ...]:
    """Return the parameters of these terms, all kept and nothing left over, as `laws_of` takes them."""
    return (Kept(0, Remainder(0.0, 0.0)), *(Kept(1, one) for one in terms))


def untouched(kinds: Sequence[str]) -> ContactState:
    """Return an object of these terms that nothing has pressed yet."""
    states = (NO_STATE, *(find_term(kind)[1].at_rest for kind in kinds))
    return ContactState(0.0, 0.0, 0.0, states, 0.0, 0.0, 0.0, math.inf)


def tolerance(accuracy: float) -> float:
    """Return the error that a step may have: as many of them then add up to a part of the accuracy."""
    return float((STEP_SHARE * accuracy) ** 1.5)


def growth(accuracy: float) -> float:
    """Return by how much steps may grow after a touch: twofold at 10 % and above, the less the more exact."""
    return 1.0 + min(1.0, math.sqrt(accuracy / GROWS))


@frozen(kw_only=True)
class _Path:
    """Closures with their times and speeds, from the contact on."""

    closures: tuple[float, ...]
    times: tuple[float, ...]
    speeds: tuple[float, ...]


class _Survey:
    """What an object does on the paths of its grasp, which no accuracy changes."""

    def __init__(
        self, thing: Thing, kinds: tuple[str, ...], force_n: float, speed_m_s: float, mass_kg: float
    ):
        self.thing, self.kinds = thing, kinds
        self.paths, self.point = _paths(thing, kinds, force_n, speed_m_s, mass_kg)
        self.forces = [_pressed(thing, kinds, path) for path in self.paths]
        self._offers: list[list[tuple[str, float]]] | None = None

    def offers(self) -> list[list[tuple[str, float]]]:
        """Return what may become of each term, by itself, and how much that changes."""
        if self._offers is None:
            self._offers = [
                [
                    (name, _difference(other, self.kinds, self.paths, self.forces))
                    for name, other in _without(self.thing, self.kinds, i, self.point)
                ]
                for i in range(len(self.kinds))
            ]
        return self._offers


@lru_cache(maxsize=256)
def _survey(
    thing: Thing, kinds: tuple[str, ...], force_n: float, speed_m_s: float, mass_kg: float
) -> _Survey:
    return _Survey(thing, kinds, force_n, speed_m_s, mass_kg)


def choose(
    full: Thing,
    kinds: Sequence[str],
    *,
    accuracy: float,
    force_n: float,
    speed_m_s: float,
    dt_s: float,
    mass_kg: float,
    damping_n_s_m: float,
    rubs: bool,
    rung: Rung = CAREFUL,
) -> Choice:
    """Return the model for a grasp that touches at this speed and squeezes with this force.

    `rubs`: whether the drive has friction.
    """
    seen = _survey(full, tuple(kinds), force_n, max(speed_m_s, LEAST_SPEED_M_S), mass_kg)
    paths, point = seen.paths, seen.point
    made, decisions, spent, thing = _leave_out(full, kinds, seen, rung.model_share * accuracy)
    rate = _damping(thing, kinds, paths, dt_s, damping_n_s_m) / mass_kg
    contact = _contact(full, kinds, paths[-1], mass_kg, dt_s)
    # Verlet lets the energy of a swing rise and fall by a share of it, which only shows where nothing else takes it.
    swing = contact.number / dt_s * (6.0 * tolerance(accuracy)) ** (2.0 / 3.0) / 4.0
    scheme = STIFF if rate * dt_s > 1.0 else MEAN_FORCE if rate < swing and not rubs else EXPLICIT
    return Choice(
        accuracy=accuracy,
        made=made,
        point=point,
        steps=Steps(
            tolerance(accuracy / rung.finer),
            scheme,
            dt_s / rung.least_steps if rung.least_steps > 1 else math.inf,
            growth=growth(accuracy / rung.finer),
        ),
        decisions=tuple(decisions),
        scheme=Decision(
            term="steps",
            decision=SCHEMES[scheme],
            what="rate of the dampers, times tick",
            number=rate * dt_s,
            error=accuracy * max(1.0 - rung.model_share, 0.0),
        ),
        contact=contact,
        error=spent,
        swings=any(
            left.kept == 1 and _swings(kind, one.params, point)
            for kind, one, left in zip(kinds, full.terms[1:], thing.terms[1:], strict=True)
        ),
        rung=rung.name,
    )


def _swings(kind: str, params: Any, point: WorkingPoint) -> bool:
    term = find_term(kind)[1]
    if term.rates is no_rates:
        return bool(term.at_rest != NO_STATE)
    return any(rate.what == "swings" for rate in term.rates(params, point))


def _contact(thing: Thing, kinds: Sequence[str], path: _Path, mass_kg: float, dt_s: float) -> Decision:
    # What a tick feels of it, all along the slow way in: a piece further within a tick, against standing there.
    press = bind(squeeze, advance=sum_of(laws_of(kinds)))
    now, stiffest, before, piece = untouched(kinds), 0.0, 0.0, path.closures[-1] / PIECES
    for k, (closure, t, speed) in enumerate(zip(path.closures, path.times, path.speeds, strict=True)):
        if speed == 0.0:
            break
        now, before = press(thing, now, closure, speed, t - before), t
        if k % 4 < 3:
            continue
        stands, further = (press(thing, now, closure + more, 0.0, dt_s).force_n for more in (0.0, piece))
        stiffest = max(stiffest, (further - stands) / piece)
    number = math.sqrt(max(stiffest, 0.0) / mass_kg) * dt_s
    # What is struck answers by itself, before what stands behind it gives way.
    touch = path.closures[0]
    at_once = _pressed(thing, kinds, _Path(closures=(touch,), times=(0.0,), speeds=(0.0,)))[0] / touch
    resolved = max(stiffest, at_once) <= 1.05 * STIFFEST_N_M and number <= 1.05
    return Decision(
        term="contact",
        decision="peak resolved" if resolved else "peak not resolved",
        what="its natural frequency, times tick",
        number=number,
        error=0.0 if resolved else math.inf,
    )


def _leave_out(
    full: Thing, kinds: Sequence[str], seen: _Survey, budget: float
) -> tuple[tuple[str, ...], list[Decision], float, Thing]:
    """Return what becomes of each term and of the covers, why, what that may cost, and what is left."""
    made, errors, spent, thing = [KEPT] * (len(kinds) + 1), [0.0] * len(kinds), 0.0, full
    decisions: list[Decision] = []
    paths, point = seen.paths, seen.point
    if budget > 0.0:
        forces, offers = seen.forces, seen.offers()
        # Those that cost least choose first, each the cheapest to compute that fits.
        for i in sorted(range(len(kinds)), key=lambda i: min(error for _, error in offers[i])):
            for name, alone in offers[i]:
                if alone > budget:
                    continue
                other = _named(name, _without(thing, kinds, i, point))
                error = _difference(other, kinds, paths, forces, budget)
                if error <= budget:
                    made[i], errors[i], thing, spent = name, alone, other, error
                    break
        for name, other in _covers(thing):
            error = _difference(other, kinds, paths, forces, budget)
            if error <= budget:
                made[-1], thing = name, other
                what = "their compression over all of it"
                share = forces[0][-1] / full.skins_n_m / max(point.compression_m, 1e-9)
                decisions.append(
                    Decision(term="covers", decision=name, what=what, number=share, error=abs(error - spent))
                )
                spent = error
                break
    for i, kind in enumerate(kinds):
        what, number = _deciding(kind, full.terms[i + 1].params, point)
        decision = made[i] if made[i] in (KEPT, DROPPED) else f"limit: {made[i]}"
        decisions.append(Decision(term=kind, decision=decision, what=what, number=number, error=errors[i]))
    return tuple(made), decisions, spent, thing


def _without(thing: Thing, kinds: Sequence[str], i: int, point: WorkingPoint) -> Iterator[tuple[str, Thing]]:
    """Yield the thing with term `i` dropped, then with it in each of its limits, by name."""
    one = thing.terms[i + 1]
    yield DROPPED, _with(thing, i, Kept(0, one.params), 0.0, 0.0)
    term = find_term(kinds[i])[1]
    for limit in term.limits(one.params, point):
        if limit.params == one.params and limit.spring_n_m == 0.0 and limit.damper_n_s_m == 0.0:
            continue
        kept = Kept(0, one.params)
        if limit.params is not None:
            kept = Kept(1, one.params._make(float(value) for value in limit.params))
        yield limit.name, _with(thing, i, kept, limit.spring_n_m, limit.damper_n_s_m)


def _named(name: str, things: Iterator[tuple[str, Thing]]) -> Thing:
    return next(thing for one, thing in things if one == name)


def _with(thing: Thing, i: int, kept: Kept, spring: float, damper: float) -> Thing:
    left = thing.terms[0].params
    spring, damper = left.spring_n_m + spring, left.damper_n_s_m + damper
    first = Kept(1 if spring > 0.0 or damper > 0.0 else 0, Remainder(spring, damper))
    terms = (first, *thing.terms[1 : i + 1], kept, *thing.terms[i + 2 :])
    return thing._replace(terms=terms)


def _covers(thing: Thing) -> Iterator[tuple[str, Thing]]:
    """Yield the thing with simpler covers, simplest first."""
    skin = thing.skin
    if thing.skins_n_m < math.inf:
        yield "rigid", thing._replace(skins_n_m=math.inf)
    if skin.damping_n_s_m > 0.0 or skin.arm_n_m > 0.0:
        yield "springs", thing._replace(skin=skin._replace(damping_n_s_m=0.0, arm_n_m=0.0))
        stiffer = thing._replace(skins_n_m=thing.skins_n_m + skin.arm_n_m)
        yield (
            "springs that do not creep",
            stiffer._replace(skin=skin._replace(damping_n_s_m=0.0, arm_n_m=0.0)),
        )


def _deciding(kind: str, params: Any, point: WorkingPoint) -> tuple[str, float]:
    """Return the number that says most about a term here: its fastest rate times the grasp, or its share of force."""
    term = find_term(kind)[1]
    rates = term.rates(params, point)
    if rates:
        fastest = max(rates, key=lambda rate: rate.per_s)
        return f"{fastest.what}, times seconds of grasp", fastest.per_s * point.seconds
    return "its force over the squeezing force", term.importance(params, point) / point.force_n


def _paths(
    thing: Thing, kinds: Sequence[str], force_n: float, speed_m_s: float, mass_kg: float
) -> tuple[list[_Path], WorkingPoint]:
    """Return the paths, up to the force there will be, and what they come to."""
    depth = _depth(thing, kinds, force_n, speed_m_s)
    # The touch itself: what moves is stopped by a spring.
    impact = speed_m_s * math.sqrt(force_n / depth * mass_kg)
    if impact > force_n:
        force_n = impact
        depth = _depth(thing, kinds, force_n, speed_m_s)
    # What yields to force in time ends up where it does when pressed slowly.
    slow_depth = _depth(thing, kinds, force_n, 0.0)
    # A step of effort on a spring: it is crossed in a quarter of a swing.
    fast = max(force_n / math.sqrt(force_n / depth * mass_kg), speed_m_s)
    paths = [
        _path(depth, depth / speed_m_s, HOLD_S),
        _path(depth, depth / fast, HOLD_S),
        _path(slow_depth, SQUEEZE_S, HOLD_S),
    ]
    return paths, WorkingPoint(slow_depth, speed_m_s, slow_depth / speed_m_s + HOLD_S, force_n)


def _depth(thing: Thing, kinds: Sequence[str], force_n: float, speed_m_s: float) -> float:
    """Return how far the fingers come in against this force, by halving; at no speed, in the time of a squeeze."""
    least, most = 0.0, DEEPEST * max(thing.width_m, 1e-4)
    for _ in range(40):
        middle = 0.5 * (least + most)
        rise = middle / speed_m_s if speed_m_s > 0.0 else SQUEEZE_S
        if any(force > force_n for force in _pressing(thing, kinds, _path(middle, rise, 0.0))):
            most = middle
        else:
            least = middle
        if most - least < 0.02 * most:
            break
    return most


def _path(depth: float, rise: float, hold: float) -> _Path:
    """Return a closure that rises evenly in this time and then stands, looked at ever more rarely."""
    speed = depth / rise
    # The touch is looked at more closely.
    shares = [*(4.0**-k / PIECES for k in range(EARLY, 0, -1)), *((k + 1) / PIECES for k in range(PIECES))]
    times = [rise * share for share in shares]
    closures = [depth * share for share in shares]
    speeds = [speed] * len(shares)
    wait = min(1e-3, hold)
    while 0.0 < wait <= hold * 1.0001:
        times.append(rise + wait)
        closures.append(depth)
        speeds.append(0.0)
        wait *= 10.0**0.5
    return _Path(closures=tuple(closures), times=tuple(times), speeds=tuple(speeds))


def _pressed(thing: Thing, kinds: Sequence[str], path: _Path) -> list[float]:
    """Return the force along the path."""
    return list(_pressing(thing, kinds, path))


def _pressing(thing: Thing, kinds: Sequence[str], path: _Path) -> Iterator[float]:
    press = bind(squeeze, advance=sum_of(laws_of(kinds)))
    now, before = untouched(kinds), 0.0
    for closure, t, speed in zip(path.closures, path.times, path.speeds, strict=True):
        now = press(thing, now, closure, speed, t - before)
        yield now.force_n
        before = t


def _difference(
    thing: Thing,
    kinds: Sequence[str],
    paths: Sequence[_Path],
    forces: Sequence[Sequence[float]],
    most: float = TOO_MUCH,
) -> float:
    """Return the greatest difference of force on the paths, against the force (a newton at the least).

    What is more than `most` is infinite: nobody asks how much more.
    """
    worst = 0.0
    for path, expected in zip(paths, forces, strict=True):
        for one, other in zip(_pressing(thing, kinds, path), expected, strict=False):
            worst = max(worst, abs(one - other) / max(abs(other), 1.0))
            if not math.isfinite(one) or worst > most:
                return math.inf
    return worst


def _damping(
    thing: Thing, kinds: Sequence[str], paths: Sequence[_Path], dt_s: float, damping: float
) -> float:
    """Return what dampers do to the fingers (N s/m): the drive's own, the covers', the object's."""
    if kinds:
        # By how much the force is greater where they move than where they stand, over a piece as long as a tick.
        fast = paths[1]
        depth, speed = fast.closures[-1], fast.speeds[0]
        back = min(speed * dt_s, 0.5 * depth)
        moving = _path(depth - back, (depth - back) / speed, 0.0)
        last = evolve(
            moving,
            closures=(*moving.closures, depth),
            times=(*moving.times, moving.times[-1] + back / speed),
            speeds=(*moving.speeds, speed),
        )
        still = evolve(last, speeds=(*moving.speeds, 0.0))
        damping += abs(_pressed(thing, kinds, last)[-1] - _pressed(thing, kinds, still)[-1]) / speed
    return damping
