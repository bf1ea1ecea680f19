"""From a setting to its exact maps: whether it is piecewise linear, and the linear forms of its terms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.linear import Linear, numbers_of, room_of
from graspsense_sim_gripper.linear_modes import Scene, Shape, listed, modes_of
from graspsense_sim_gripper.plant import Thing
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.remainder import linear as remainder_form
from graspsense_sim_gripper.terms.term import LinearForm, OwnContact

if TYPE_CHECKING:
    from graspsense_sim_gripper.setting import Setting


def linear_of(config: SimConfig, setting: Setting, *, on_arrays: bool = False) -> tuple[Linear, Shape] | None:
    """Return the plant of a setting with its maps, and their shape; None where it is not linear, or is not to be.

    `on_arrays`: as compiled code takes them; plain Python is quicker with lists. Raises TypeError for a term whose
    linear form has other states than its law.
    """
    plant = setting.plant
    drive, thing, steps = plant.drive, plant.thing, plant.steps
    forced = config.scheme != "auto" or steps.longest_s < math.inf or steps.settle > 0.0
    # Held off the centre, each half would need a mode of its own.
    if (
        forced
        or drive.link.finger_m != 0.0
        or drive.breakaway_n != drive.coulomb_n
        or (thing.held == 1 and setting.body.contact.offset_m != 0.0)
    ):
        return None
    forms = forms_of(thing, setting.kinds)
    if forms is None:
        return None
    scene = Scene(
        drive.inertia / setting.body.motion.jacobian_m_rev**2,
        drive.damping_n_s_m,
        drive.breakaway_n > 0.0,
        drive.load_share,
        drive.lag_s,
        thing.skins_n_m,
        thing.skin,
        forms,
    )
    modes = modes_of(scene, setting.dt_s) if on_arrays else listed(scene, setting.dt_s)
    if modes is None:
        return None
    shape, look, *tables = modes
    numbers = room_of(shape)
    room: Any = np.zeros(numbers) if on_arrays else [0.0] * numbers
    return Linear(plant, look, *(*tables, room)), shape


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
