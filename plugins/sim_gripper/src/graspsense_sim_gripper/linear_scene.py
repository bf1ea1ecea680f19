"""From a setting to its exact maps: which terms have linear forms, and what of them stands in straight pieces.

What hangs on the compression alone and is no straight line is cut into pieces between knots; the linkage is taken as it
is half way through the squeeze, with how the mass that moves differs elsewhere beside it. `linear` follows the maps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.plugin_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.linear import Lever, Linear, numbers_of, room_of
from graspsense_sim_gripper.linear_modes import Scene, Shape, Straight, listed, modes_of
from graspsense_sim_gripper.plant import Thing
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.remainder import linear as remainder_form
from graspsense_sim_gripper.terms.term import LinearForm, OwnContact

if TYPE_CHECKING:
    from graspsense_sim_gripper.selection import Choice
    from graspsense_sim_gripper.setting import Setting

LEAST_SHARE: Final = 0.05
"""At least this share of a squeeze is the object's, as its depth is known to a few hundredths; the rest the covers'."""
LEVER_M: Final = 5e-3
"""So far about the squeeze the parabola of the moving mass goes through what it is."""


def linear_of(config: SimConfig, setting: Setting, *, on_arrays: bool = False) -> tuple[Linear, Shape] | None:
    """Return the plant of a setting with its maps, and their shape; None where it is not linear, or is not to be.

    `on_arrays`: as compiled code takes them; plain Python is quicker with lists. Raises TypeError for a term whose
    linear form has other states than its law.
    """
    plant = setting.plant
    drive, thing, steps = plant.drive, plant.thing, plant.steps
    forced = config.scheme != "auto" or steps.longest_s < math.inf or steps.settle > 0.0
    pieces = 0 if setting.choice is None else setting.choice.pieces
    # Held off the centre, each half would need a mode of its own.
    if (
        forced
        or (pieces == 0 and (drive.link.finger_m != 0.0 or drive.breakaway_n != drive.coulomb_n))
        or (thing.held == 1 and setting.body.offset_m != 0.0)
    ):
        return None
    forms = forms_of(thing, setting.kinds)
    if forms is None or (pieces == 0 and is_bent(forms)):
        return None
    reach, bend = 1.0, (Straight(0.0, 0.0),) * min(pieces, 1)
    if is_bent(forms):
        assert setting.choice is not None
        reach = _reach(forms, setting.choice, thing)
        bend = _straightened(forms, reach, pieces)
    lever = _lever(setting)
    scene = Scene(
        lever.mass_kg,
        drive.damping_n_s_m,
        drive.breakaway_n > 0.0,
        drive.load_share,
        drive.lag_s,
        thing.skins_n_m,
        thing.skin,
        forms,
        bend,
    )
    modes = modes_of(scene, setting.dt_s) if on_arrays else listed(scene, setting.dt_s)
    if modes is None:
        return None
    shape, look, *tables = modes
    numbers = room_of(shape)
    room: Any = np.zeros(numbers) if on_arrays else [0.0] * numbers
    knots: Any = _knots(reach, len(bend))[:-1] if bend else []
    slopes: Any = [piece.slope_n_m for piece in bend]
    if on_arrays:
        knots, slopes = np.array(knots, float), np.array(slopes, float)
    return Linear(plant, look, lever, knots, slopes, *(*tables, room)), shape


def _lever(setting: Setting) -> Lever:
    drive, gap = setting.plant.drive, setting.body.gap_m
    link = drive.link
    if link.finger_m == 0.0 or setting.choice is None:
        return Lever(drive.inertia / setting.body.rate_m_rev**2, gap, 0.0, 0.0)
    # About half way through the squeeze, where it counts.
    gap = max(setting.plant.thing.width_m - 0.5 * setting.choice.point.compression_m, LEVER_M)
    closer, rate, wider = (
        gap_and_rate(link, revolutions_at(link, place))[1] for place in (gap - LEVER_M, gap, gap + LEVER_M)
    )
    less, more = (closer / rate) ** 2 - 1.0, (wider / rate) ** 2 - 1.0
    first, second = 0.5 * (more - less) / LEVER_M, 0.5 * (more + less) / LEVER_M**2
    return Lever(drive.inertia / rate**2, gap, first, second)


def forms_of(thing: Thing, kinds: Sequence[str]) -> tuple[LinearForm | OwnContact, ...] | None:
    """Return the linear forms of what is kept of an object; None where a term has none.

    Raises TypeError for a term whose linear form has other states than its law.
    """
    rest = thing.terms[0]
    forms: list[LinearForm | OwnContact] = [remainder_form(rest.params)] if rest.kept == 1 else []
    for kind, one in zip(kinds, thing.terms[1:], strict=True):
        if one.kept == 0:
            continue
        form = _form(kind, one.params)
        if form is None:
            return None
        forms.append(form)
    return tuple(forms)


def is_bent(forms: Sequence[LinearForm | OwnContact]) -> bool:
    """Return whether one of them has a curve."""
    return any(isinstance(form, LinearForm) and form.curve is not None for form in forms)


def _curve(forms: Sequence[LinearForm | OwnContact], d: float) -> float:
    """Return the force of all curves at a compression."""
    return sum(form.curve(d) for form in forms if isinstance(form, LinearForm) and form.curve is not None)


def _reach(forms: Sequence[LinearForm | OwnContact], choice: Choice, thing: Thing) -> float:
    """Return how far the object is compressed at the greatest force that the choice holds for.

    As far as the curves and the springs beside them say, and no further than the squeeze goes in which all takes part.
    """
    point = choice.point
    squeezed = point.compression_m - point.force_n / thing.skins_n_m
    most = choice.most_n / point.force_n * max(squeezed, LEAST_SHARE * point.compression_m)
    springs = sum(form.spring_n_m for form in forms if isinstance(form, LinearForm) and not form.rates)
    least = 0.0
    for _ in range(60):
        middle = math.sqrt(least * most) if least > 0.0 else 0.01 * most
        if _curve(forms, middle) + springs * middle < choice.most_n:
            least = middle
        else:
            most = middle
        if most < 1.01 * least:
            break
    return most


def _knots(reach: float, pieces: int) -> list[float]:
    """Return between which compressions the pieces are, closer where they begin: at even roots."""
    return [reach * (k / pieces) ** 2 for k in range(pieces + 1)]


def _straightened(
    forms: Sequence[LinearForm | OwnContact], reach: float, pieces: int
) -> tuple[Straight, ...]:
    """Return the curves together in straight pieces between knots."""
    places = _knots(reach, pieces)
    forces = [_curve(forms, place) for place in places]
    found = []
    for (d0, d1), (force0, force1) in zip(pairwise(places), pairwise(forces), strict=True):
        slope = (force1 - force0) / (d1 - d0)
        found.append(Straight(slope, force0 - slope * d0))
    return tuple(found)


@lru_cache(maxsize=256)
def _form(kind: str, params: Any) -> LinearForm | OwnContact | None:
    """Return a term's linear form. Raises TypeError where it has other states than the law."""
    term = find_term(kind)[1]
    form = term.linear(params)
    if form is None:
        return None
    count = numbers_of(term.at_rest)
    for one in (form.touching, form.parted) if isinstance(form, OwnContact) else (form,):
        if len(one.rates) not in (0, count):
            raise TypeError(
                f"term {kind!r}: its linear form has {len(one.rates)} states, the law's are "
                f"{len(term.at_rest)}, {term.at_rest!r}: as many as it has fields, all of them floats"
            )
    if isinstance(form, LinearForm) and not form.rates and count:
        # What the form leaves as it is stands in the state like all else, and stands still.
        none = (0.0,) * count
        return form._replace(rates=(none,) * count, by_compression=none, by_speed=none, force=none)
    return form
