"""Whether a chosen model keeps its word: a trial grasp in it, beside one in the full model with finer steps.

The nominal object is grasped with ideal sensors, from the open fingers to the release, under the controller that is to
grasp it. The first such grasp, in the full model, also tells how fast it touches and what force comes
of it. Then the model that the boldest rung of the ladder proposes is tried; where the two differ by too much, the next
rung's.

One that holds is tried twice more, with a controller that is told a little more of force and travel, and a little
less, by as much as such a model may be wrong: where a threshold is met so nearly at a tick that the grasp then goes on
a tick earlier or later, and that shows, both grasps may have been on the wrong side of it, and one in finer steps is
tried. Where even the last does not hold there is no model of this scene at that accuracy, and that is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import define, evolve, field, fields

from graspsense.plugin_api import (
    CELLS,
    CONTACT_FORCE_N,
    HOLD,
    ConfigError,
    Controller,
    NotCompilable,
    RunConfig,
    create,
    first_state,
    gap_and_rate,
    revolutions_at,
    seconds_at_most,
    tick_params,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.state import Motion
from graspsense_sim_gripper.exact.discretise import discretise
from graspsense_sim_gripper.kernel import grasp_of
from graspsense_sim_gripper.loop import COLUMNS, NOT_STARTED, Buffers, GraspParams, Progress, has_ended
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.plant import EXPLICIT, Steps
from graspsense_sim_gripper.reduction import cache
from graspsense_sim_gripper.reduction.error import Course, deviation
from graspsense_sim_gripper.selection import BOLD, DROPPED, FINE, FULL_LADDER, LADDER, Check, Choice, Rung
from graspsense_sim_gripper.sensing import Bias, PadBuffers
from graspsense_sim_gripper.setting import (
    EFFORT_LIMIT_N,
    FORCE_N,
    SPEED_M_S,
    Setting,
    choice_of,
    device_info,
    setting_of,
)
from graspsense_sim_gripper.terms.registry import laws_of

HELD: Final = 0.5
HELD_ALONE: Final = 0.8
"""A model holds where the trial grasps differ by less than this part of the accuracy. Instances of the object
have the rest; where it is grasped as it is tried, only pads and what the trial grasps are off by themselves have."""
APART: Final = 10.0
LEAST_OFF_N: Final = 0.01
MOST_OFF_N: Final = 0.25
"""What a controller is told of forces may be wrong by so many times what two models are apart at the contact, and by so
much at the least and at the most, times the accuracy over how fine a rung's steps are."""
OFF_TRAVEL: Final = 0.025
"""And by such a part, times the same, what it is told of the way since the touch, of which rest is made out."""
BESIDE: Final = {
    1.0: Rung("to check", 0.0, 30.0, 2),
    10.0: Rung("to check", 0.0, 100.0, 8),
    100.0: Rung("to check", 0.0, 1000.0, 32),
}
"""Beside which grasp a rung's is laid, by how fine its own steps are."""
COARSE: Final = 0.03
"""From this accuracy on a threshold met too nearly is looked at again with a tenth of it."""
TELLING: Final = 0.2
"""A term without which no more than this part of an error is left is what made it."""
STRICT: Final = 0.003
"""From this accuracy on that is cut into twice as many steps: a touch that one step sees and another does not."""
LONGEST_S: Final = 40.0
"""No trial grasp takes longer, and no approach in one."""
NEAR_M: Final = 3e-3
"""Where a slow approach has not come by then, it is taken up again this near to the object."""
MOST_HOLD_S: Final = 0.3
LEAP: Final = 50
"""Most ticks at once on the way to the object."""
ROOM: Final = 4096


@define(eq=False)
class Control:
    """What is to grasp: a controller with the settings of its runs."""

    controller: Controller[Any]
    run: RunConfig

    def key(self) -> tuple[Any, ...]:
        """Return what a grasp follows from."""
        law = self.controller
        # As text, for NaN is not equal to itself.
        return type(law).step, repr((law.params(), law.init(), self.run.hold_s, self.run.grasp_timeout_s))


def standard(config: SimConfig) -> Control:
    """Return the paper's controller, at the speed and the force that are expected."""
    force = min(config.expected_force_n or FORCE_N, EFFORT_LIMIT_N)
    speed = config.expected_speed_m_s or SPEED_M_S
    return Control(
        create("controller", "hybrid", probing_force_n=force, closing_speed_m_s=speed), RunConfig()
    )


Loops = Callable[[Setting, Callable[..., Any]], tuple[Callable[..., Any], Setting] | None]
"""Gives the compiled loop for a setting under this step of a controller, and the setting as that takes it.

None: it is to run plain."""
_WITHOUT: Final[dict[str, Any]] = {
    one.name: one.default
    for one in fields(SimConfig)
    if one.name in ("object", "explain", "compile") or one.name.startswith(("pad_", "noise_"))
} | {"sensor": "ideal"}
"""What a trial grasp does without, and no choice hangs on."""
_CHECKED: dict[tuple[Any, ...], tuple[ObjectSpec, Choice]] = {}


def checked_choice(
    config: SimConfig, spec: ObjectSpec, control: Control, loops: Loops | None = None
) -> Choice:
    """Return the model of an object that a trial grasp has found to be as exact as asked for.

    What was found is kept on disk. One whose steps are forced, a reference, and one whose peak cannot be resolved
    (which it says) are not checked. Raises ConfigError where no model is as exact as asked for.
    """
    bare = evolve(config, **_WITHOUT)
    key = (bare, id(spec), control.key())
    if key not in _CHECKED:
        mark = cache.mark_of(spec, *control.key(), bare)
        choice = None if mark is None else cache.find(mark)
        if choice is None:
            choice = _check(bare, spec, control, loops)
            if mark is not None and choice.check is not None:
                cache.keep(mark, choice)
        _CHECKED[key] = spec, choice
    return _CHECKED[key][1]


@define(eq=False)
class Checking:
    """Chooses for many grasps of one config, looking up by the object alone what was chosen before."""

    control: Control
    loops: Loops | None = None
    _known: dict[int, tuple[SimConfig, ObjectSpec, Choice]] = field(factory=dict, init=False)

    def __call__(self, config: SimConfig, spec: ObjectSpec) -> Choice:
        """Return `checked_choice` of these."""
        known = self._known.get(id(spec))
        if known is None or known[0] is not config:
            known = config, spec, checked_choice(config, spec, self.control, self.loops)
            self._known[id(spec)] = known
        return known[2]


def _check(bare: SimConfig, spec: ObjectSpec, control: Control, loops: Loops | None) -> Choice:
    forced = bare.scheme != "auto" or bare.step_s is not None
    if forced or bare.fidelity == "reference":
        return choice_of(bare, spec)
    trial = _Trial(config=evolve(bare, spread=False), spec=spec, control=control, loops=loops)
    strict = 2 if bare.accuracy <= STRICT else 1
    beside = {finer: rung._replace(least_steps=strict * rung.least_steps) for finer, rung in BESIDE.items()}
    finest = choice_of(bare, spec, rung=beside[1.0])
    if math.isinf(finest.contact.error):
        return choice_of(bare, spec)
    try:
        first = trial.course(finest)
    except Exception:
        # A controller of anybody's may fail; in the grasp itself that is an outcome, and said.
        return choice_of(bare, spec)
    chosen = partial(choice_of, force_n=_about(first.peak_n), speed_m_s=_about(first.touched_at_m_s()))
    if math.isinf(chosen(bare, spec, rung=beside[1.0]).contact.error):
        return chosen(bare, spec)
    least, whose, made = math.inf, "", 1
    edge: _Edge | None = None
    tried: set[Any] = set()
    for rung in _ladder(bare):
        if edge is not None and rung.finer <= edge.finer:
            continue
        choice = chosen(bare, spec, rung=rung)
        model = choice.made, choice.steps
        if model in tried:
            continue
        tried.add(model)
        expected = trial.course(chosen(bare, spec, rung=beside[rung.finer]))
        error, quantity = deviation(trial.course(choice), expected)
        made += 1
        if error <= _held(bare) * bare.accuracy:
            made += 2
            edge = _edge(trial, choice, expected, rung.finer)
            if error + edge.change <= bare.accuracy:
                return evolve(choice, check=Check(error=error, quantity=quantity, grasps=made))
        elif error < least:
            least, whose = error, quantity
    if edge is not None:
        if bare.accuracy >= COARSE:
            # Steps this coarse are off by more than what is met so nearly; finer ones tell it apart.
            finer = evolve(bare, accuracy=0.1 * bare.accuracy)
            with suppress(ConfigError):
                return evolve(_check(finer, spec, control, loops), accuracy=bare.accuracy)
        raise ConfigError(_undecided(bare, spec, edge))
    term = _culprit(trial, *(chosen(bare, spec, rung=rung) for rung in (FINE, beside[FINE.finer])))
    raise ConfigError(_refusal(bare, spec, least, whose, term))


def _ladder(config: SimConfig) -> tuple[Rung, ...]:
    if config.fidelity != "scene":
        return FULL_LADDER
    # What only just holds for the object that is tried need not for others of its kind.
    return LADDER[LADDER.index(BOLD) :] if config.spread else LADDER


def _held(config: SimConfig) -> float:
    return HELD if config.spread else HELD_ALONE


class _Edge(NamedTuple):
    """What a grasp hangs on: where what its controller is told is off by as much, this quantity changes."""

    force_n: float
    travel: float
    change: float
    quantity: str
    finer: float


def _edge(trial: _Trial, choice: Choice, expected: Course, finer: float) -> _Edge:
    """Return what becomes of this model's grasp where forces and travel are off by as much as they may be wrong."""
    exact, scale = trial.course(choice), trial.config.accuracy / finer
    force_n = max(APART * _apart_n(exact, expected), LEAST_OFF_N * scale)
    force_n, travel = min(force_n, MOST_OFF_N * scale), OFF_TRAVEL * scale
    others = (trial.course(choice, (sign * force_n, sign * travel)) for sign in (-1.0, 1.0))
    change, quantity = max(deviation(other, exact) for other in others)
    return _Edge(force_n, travel, change, quantity, finer)


def _apart_n(one: Course, expected: Course) -> float:
    """Return how far the forces of two grasps are apart where both pads come to feel the contact force."""
    felt, wanted = (np.minimum(course.left_n, course.right_n) for course in (one, expected))
    i = min(int(np.argmax(force >= CONTACT_FORCE_N)) for force in (felt, wanted))
    there = slice(max(i - 1, 0), i + 1)
    return float(np.max(np.abs(felt[there] - wanted[there])))


def _about(value: float) -> float:
    """Return it to two digits: no choice hangs on more, and what is chosen of like grasps is then looked at once."""
    return float(f"{value:.1e}")


def _culprit(trial: _Trial, fine: Choice, finer: Choice) -> str:
    """Return the term without which the grasp hangs least on its steps, or nothing where all of them matter alike."""
    errors = {}
    for i, (kind, _) in enumerate(trial.spec.terms):
        made = (*fine.made[:i], DROPPED, *fine.made[i + 1 :])
        errors[kind] = deviation(*(trial.course(evolve(one, made=made)) for one in (fine, finer)))[0]
    whole, _ = deviation(trial.course(fine), trial.course(finer))
    least = min(errors, key=errors.__getitem__, default="")
    return least if least and errors[least] < TELLING * whole else ""


def _undecided(config: SimConfig, spec: ObjectSpec, edge: _Edge) -> str:
    changes = f"{edge.quantity} by {edge.change:.2g}" if math.isfinite(edge.change) else "its outcome"
    return (
        f"{_exactness(config, spec)}: the controller decides on a threshold that is met at a tick within "
        f"{edge.force_n:.1g} N, or {edge.travel:.1g} of the travel, so that the grasp may as well go on "
        f"a tick earlier or later, which changes {changes}. Let ticks fall otherwise (gripper.open_gap_m, or the "
        f"controller's speed or threshold); else {_way_out(2.0 * edge.change)}"
    )


def _refusal(config: SimConfig, spec: ObjectSpec, least: float, whose: str, term: str) -> str:
    found = f"{whose} differs by {least:.2g}" if math.isfinite(least) else "not even the outcome is the same"
    blamed = f"steps through the term {term!r}" if term else "steps, and not through any one term"
    return (
        f"{_exactness(config, spec)}: with every term kept and in the finest steps, between two of them {found}. "
        f"The grasp hangs on its {blamed}; {_way_out(2.0 * least / _held(config))}"
    )


def _exactness(config: SimConfig, spec: ObjectSpec) -> str:
    where = spec.file or f"object {spec.name!r}"
    return f"{where}: no model of it is as exact as gripper.accuracy = {config.accuracy:g} asks for"


def _way_out(can: float) -> str:
    """Return what to do where this is an accuracy that can be had."""
    advice = f"ask for {can:.1g} (gripper.accuracy), or " if can <= 0.5 else ""
    return f'{advice}take what comes out unchecked with gripper.fidelity = "reference"'


class _Stand(NamedTuple):
    """A trial grasp under way: its state, and what was recorded."""

    progress: Progress
    rows: tuple[Any, ...]
    """The columns of `COLUMNS` and the phases behind them, piece by piece."""
    far: bool
    """Whether it began with the fingers open."""


Drive = Callable[[Steps, _Stand, int], _Stand]
"""Takes a grasp on from where it stands, in such steps, until this tick."""


@define(eq=False)
class _Trial:
    """The grasp of one object under one controller, in one model after the other."""

    config: SimConfig
    spec: ObjectSpec
    control: Control
    loops: Loops | None
    _courses: dict[Any, Course] = field(factory=dict, init=False)
    _before: _Stand | None = field(default=None, init=False)
    """Shortly before the first touch, until when all models are alike."""

    def course(self, choice: Choice, off: tuple[float, float] = (0.0, 0.0)) -> Course:
        """Return how the grasp goes in this model.

        `off`: by how much (N) forces are wrong that its controller is told, and by what part the way since the touch.
        """
        key = (choice.made, choice.steps, off)
        if key not in self._courses:
            try:
                self._courses[key] = self._grasp(choice, off)
            except NotCompilable:
                self.loops = None
                self._courses[key] = self._grasp(choice, off)
        return self._courses[key]

    def _grasp(self, choice: Choice, off: tuple[float, float]) -> Course:
        setting = setting_of(self.config, self.spec, 0, chooser=lambda config, spec: choice)
        if self._before is None:
            self._before = self._approach(setting)
        before = self._before
        bias = Bias(*off, setting.plant.thing.width_m)
        setting = evolve(setting, sensor=setting.sensor._replace(bias=bias))
        at_end = self._driven(setting, before.far)(
            setting.plant.steps, before, before.progress.loop.ticks + self._ticks(setting)
        )
        columns, end = np.concatenate(at_end.rows, axis=1), at_end.progress
        gap_m, left_n, right_n = (
            columns[COLUMNS.index(name)] for name in ("gap_m", "force_left_n", "force_right_n")
        )
        return Course(
            outcome=int(end.controller.law.outcome) if end.controller.guard.stopped == 0 else -1,
            dt_s=setting.dt_s,
            gap_m=gap_m
            + (bias.from_m - np.minimum(gap_m, bias.from_m)) * bias.travel_share / (1.0 + bias.travel_share),
            speed_m_s=columns[COLUMNS.index("velocity_m_s")],
            left_n=np.where(left_n != 0.0, left_n - bias.force_n, 0.0),
            right_n=np.where(right_n != 0.0, right_n - bias.force_n, 0.0),
            ended=int(np.sum(columns[-1] <= HOLD)),
            peak_n=end.plant.peak_n,
        )

    def _ticks(self, setting: Setting) -> int:
        return math.ceil(min(LONGEST_S, seconds_at_most(self.control.run)) / setting.dt_s)

    def _approach(self, setting: Setting) -> _Stand:
        """Return the grasp as it stands shortly before the first touch."""
        # Not cut into short steps, as nothing happens.
        steps = setting.plant.steps._replace(scheme=EXPLICIT, longest_s=math.inf)
        reach = setting.plant.thing.width_m + 2.0 * abs(setting.body.contact.offset_m)
        link = setting.plant.drive.link
        law = self.control.controller
        for far in (True, False):
            body = setting.body
            if not far:
                near = revolutions_at(link, min(body.motion.gap_m, reach + NEAR_M))
                gap, rate = gap_and_rate(link, near)
                body = body._replace(motion=Motion(near, body.motion.speed_rev_s, gap, rate))
            drive = self._driven(setting, far)
            state = first_state(law.init())
            now = _Stand(Progress(NOT_STARTED, body, setting.sensed, state), (), far)
            while not has_ended(now.progress.controller):
                ticks, motion = now.progress.loop.ticks, now.progress.plant.motion
                if ticks >= self._ticks(setting):
                    break
                closing = max(-motion.speed_rev_s * motion.jacobian_m_rev, SPEED_M_S)
                ahead = 0.5 * (motion.gap_m - reach) / (closing * setting.dt_s)
                if ahead < 2.0:
                    return now
                after = drive(steps, now, ticks + min(int(ahead), LEAP))
                if after.progress.plant.contact.touched == 1:
                    return now
                now = after
            if has_ended(now.progress.controller):
                break
        return now

    def _driven(self, setting: Setting, far: bool) -> Drive:
        law, run = self.control.controller, self.control.run
        info = device_info(self.config)
        if not far:
            # Neither opened nor let go: it begins where it would open.
            info = evolve(info, opening=None)
        params = tick_params(info, law, evolve(run, hold_s=min(run.hold_s, MOST_HOLD_S)))
        step = type(law).step
        compiled = None if self.loops is None else self.loops(setting, step)
        on_arrays = compiled is not None
        loop, made = compiled or (None, setting)
        by_maps = discretise(self.config, made, on_arrays=on_arrays)
        # An ideal sensor reads none of these, but compiled code has them.
        zero, noise = np.zeros((2, CELLS)), np.zeros((1, 2 * CELLS))
        pads = PadBuffers(zero[0], zero[1], noise, np.full((1, 2, CELLS), math.nan))
        times: Any = np.zeros(1)
        if loop is None:
            shape = None if by_maps is None else (setting.kinds, by_maps[1])
            loop = grasp_of(laws_of(setting.kinds), step, by_maps=shape)
            pads, times = PadBuffers(*(part.tolist() for part in pads)), times.tolist()

        def drive(steps: Steps, at: _Stand, until: int) -> _Stand:
            progress, rows, _ = at
            if progress.plant.contact.touched == 0:
                # What nothing has pressed yet, as this composition has it.
                contact, fresh = progress.plant.contact, made.body.contact
                contact = contact._replace(left=fresh.left, right=fresh.right)
                progress = progress._replace(plant=progress.plant._replace(contact=contact))
            plant: Any = made.plant._replace(steps=steps) if by_maps is None else by_maps[0]
            grasp_params = GraspParams(plant, made.sensor, params, setting.dt_s, until)
            while not has_ended(progress.controller) and progress.loop.ticks < until:
                table = np.zeros((len(COLUMNS), min(until - progress.loop.ticks, ROOM)))
                numbers = np.zeros(table.shape[1], np.int64)
                given = (table, numbers) if on_arrays else (table.tolist(), numbers.tolist())
                progress = progress._replace(loop=progress.loop._replace(recorded=0))
                progress = loop(grasp_params, progress, Buffers(pads, times, *given))
                rows = (*rows, np.vstack(given)[:, : progress.loop.recorded])
            return _Stand(progress, rows, at.far)

        return drive
