"""The task `touch`: grasp a thing of a MuJoCo scene, lift it, tug at it or fill it, put it down; say how it went."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, gt, in_, le
from numpy.typing import NDArray

from graspsense.experiment_api import settings_from, structured
from graspsense.plugin_api import HOLD, NO_PADS, ConfigError, Frame, Reading, Samples, Trace
from graspsense.simulator_api import BatchBackend
from graspsense_romano.signals import FILTERS, NO_SIGNALS, Signals, updated

LIFT_S: Final = 2.0
"""When the arm lifts, after both fingers touched."""
SETTLED_S: Final = 0.5
"""Time from the end of the lift until the tug, the filling or the way down begins, and from then until a bump."""
PUBLISHED_LOW_N, WIDE_LOW_N = 0.18, 1.0
"""Low band below which a slip is told: the published one, and that of the pipeline `hold`."""
BALL_M: Final = 0.05
"""The ball of a bump comes from this far away at most."""
MUJOCO_GRAVITY_M_S2: Final = 9.81
"""MuJoCo's default (`opt.gravity`), with which the scenes move."""
LAST_S: Final = 0.15
AROUND_S: Final = (-0.05, 0.3)
"""What counts as being put down, around the time at which the arm is as high as the table."""


STARTING_S: Final = 0.2
"""Time in which the arm reaches its speed, and in which it stops."""
POINTS: Final = 20
FOLLOWED: Final = (
    *("t_s", "gap_m", "velocity_m_s"),
    *("force_left_n", "force_right_n", "edge_left_n", "edge_right_n"),
)
"""Columns of a trace that its signals follow from."""


def _moved(start_s: float, begin_m: float, end_m: float, speed_m_s: float) -> list[list[float]]:
    """Return times and heights of the arm from one height to another, with a constant acceleration at both ends."""
    sign, share = (1.0 if end_m > begin_m else -1.0), np.arange(POINTS + 1) / POINTS
    travel_s = max(abs(end_m - begin_m) / speed_m_s, STARTING_S + 1e-3)
    speed_m_s = abs(end_m - begin_m) / travel_s
    starting = 0.5 * share**2 * STARTING_S * speed_m_s
    starts = zip(start_s + share * STARTING_S, begin_m + sign * starting, strict=True)
    last = zip(start_s + travel_s + share * STARTING_S, end_m - sign * starting[::-1], strict=True)
    return [[round(float(t), 5), round(float(z), 7)] for t, z in (*starts, *last)]


@frozen(kw_only=True)
class TouchSettings:
    """The keys of `[judge]`: the scene. What is 0 does not happen."""

    thing: str = "block"
    stiffness_n_m: float = field(default=0.0, validator=ge(0.0))
    """Above 0, the thing is two walls on springs, 40 mm wide, instead of one of the catalogue."""
    mass_kg: float = field(default=0.15, validator=gt(0.0))
    friction: float = field(default=0.5, validator=ge(0.0))
    roughness_m: float = field(default=4e-5, validator=[ge(0.0), le(1e-3)])
    lift_m: float = field(default=0.05, validator=ge(0.0))
    lift_s: float = field(default=0.5, validator=gt(0.0))
    tug_n: float = field(default=0.0, validator=ge(0.0))
    fill_kg: float = field(default=0.0, validator=ge(0.0))
    ramp_s: float = field(default=2.0, validator=gt(0.0))
    """Time over which the tug or the filling grows."""
    lower_m_s: float = field(default=0.0, validator=ge(0.0))
    """Speed at which the arm goes down again."""
    table_rise_m: float = field(default=0.0, validator=ge(0.0))
    """How far the table has risen by then."""
    bump_at: str = field(default="", validator=in_(("", "finger", "thing")))
    """What a ball bumps into from the side."""
    bump_kg: float = field(default=0.1, validator=gt(0.0))
    bump_m_s: float = field(default=0.3, validator=gt(0.0))
    bump_touch_s: float = field(default=0.05, validator=gt(0.0))
    """How long the ball touches."""

    def __attrs_post_init__(self) -> None:
        if self.lower_m_s and self.table_rise_m >= self.lift_m:
            raise ValueError("table_rise_m is below lift_m: the table must not reach the thing in the air")

    @property
    def disturbed_s(self) -> float:
        """When the tug, the filling or the way down begins, after both fingers touched."""
        return LIFT_S + self.lift_s + SETTLED_S

    @property
    def bumped_s(self) -> float:
        """When the ball of a bump is thrown."""
        return self.disturbed_s + SETTLED_S

    @property
    def down_s(self) -> float:
        """When the thing is as high as the table again, after both fingers touched; NaN without a way down."""
        if not self.lower_m_s:
            return float("nan")
        return self.disturbed_s + 0.5 * STARTING_S + (self.lift_m - self.table_rise_m) / self.lower_m_s

    def toml(self) -> str:
        """Return the scene file."""
        begun_s, end_s = self.disturbed_s, self.disturbed_s + self.ramp_s
        arm = _moved(LIFT_S, 0.0, self.lift_m, self.lift_m / self.lift_s)
        keys: dict[str, Any] = {"thing": self.thing, "table": True, "friction": self.friction}
        keys |= {"mass_kg": self.mass_kg, "roughness_m": self.roughness_m}
        if self.lower_m_s:
            arm += _moved(begun_s, self.lift_m, 0.0, self.lower_m_s)
        keys["arm"] = arm
        if self.fill_kg:
            keys["fill"] = [[begun_s, 0.0], [end_s, self.fill_kg]]
        if self.table_rise_m:
            keys["table_height"] = [[LIFT_S + self.lift_s, 0.0], [begun_s, self.table_rise_m]]
        if self.tug_n:
            keys["cord.force"] = [[begun_s, 0.0], [end_s, self.tug_n]]
        if self.bump_at:
            keys |= {"bump.at": self.bump_at, "bump.t_s": self.bumped_s, "bump.mass_kg": self.bump_kg}
            keys |= {"bump.speed_m_s": self.bump_m_s, "bump.touch_s": self.bump_touch_s}
        if self.stiffness_n_m:
            keys |= {"walls.width_m": 0.04, "walls.stiffness_n_m": self.stiffness_n_m}
            # Without the usual inertia of walls, which an impact feels.
            keys |= {"walls.armature_kg": 0.0, "walls.damping_n_s_m": 20.0}
            keys |= {"walls.mass_kg": self.mass_kg, "walls.friction": self.friction}
        # Numbers, texts and lists are the same in JSON and in TOML.
        return "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())


@frozen(kw_only=True)
class TouchRow:
    """How one grasp went. Forces are of the weaker finger; a quantity that is not defined is None."""

    outcome: str
    law: str = ""
    mass_kg: float = 0.0
    friction: float = 0.0
    needed_n: float | None = None
    """The force that friction needs for the weight and what is added to it."""
    limited: bool = False
    """Whether the law asked for all of its force limit."""
    broken: bool = False
    lifted_m: float = 0.0
    slip_m: float = 0.0
    contact_n: float | None = None
    """The greatest force within 50 ms after both pads touch."""
    grip_n: float | None = None
    """The force when the grip is reached."""
    greatest_n: float | None = None
    """The greatest force while it is held."""
    deformed_m: float | None = None
    """How far the gap closed from the contact on."""
    slips: int = 0
    slip_high_n: float | None = None
    """The greatest high band of a pad after the lift, while its low band is below 0.18 N, where no force is added.

    That is the least threshold that tells no slip. The last 0.15 s are left out: a thing that is lost falls then."""
    slip_wide_n: float | None = None
    """The same, while the low band is below 1 N."""
    shock_before_m_s2: float | None = None
    """The greatest acceleration band on the way down, before the table."""
    shock_at_m_s2: float | None = None
    """The greatest acceleration band when the thing meets the table, if it is not let go by then."""
    placed_s: float | None = None
    """When the law let go, from the time at which the thing is as high as the table."""
    bump_at: str = ""
    edge_before_n: float | None = None
    """The greatest high band of an edge while the thing is held, before the bump."""
    edge_at_n: float | None = None
    """The same in the bump."""
    still_m_s2: float | None = None
    """The greatest acceleration band from 0.5 s after the lift on, before the bump."""
    bump_m_s2: float | None = None
    """The same in the bump."""
    source: str = "grasps simulated by MuJoCo"
    simulated: bool = True


def touch(params: Mapping[str, Any], seed: int) -> TouchRow:
    """Return how a grasp of the scene went. Raises ConfigError for a gripper that is not simulated by MuJoCo."""
    scene = structured(params["judge"], TouchSettings, "[judge]")
    settings = settings_from(params["settings"], "the settings of the task")
    backend = settings.gripper.create()
    if not isinstance(backend, BatchBackend) or settings.gripper.component.name != "mujoco":
        raise ConfigError("experiments of kind touch need scenes in MuJoCo: gripper.type = 'mujoco'")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(scene.toml(), encoding="utf-8")
        grasped = backend.run_many(
            settings.controller.create(),
            [str(path)],
            [seed],
            run=evolve(settings.run, seed=seed),
            extract=lambda trace: measured(trace, scene),
            workers=1,
        )[0]
    report, quantities = grasped.report, dict(grasped.extracted)
    law, pulled_n = (
        settings.controller.component.name,
        (scene.mass_kg + scene.fill_kg) * MUJOCO_GRAVITY_M_S2 + scene.tug_n,
    )
    if law != "force-servo":
        quantities |= {"slip_high_n": None, "slip_wide_n": None}
    return TouchRow(
        outcome=grasped.outcome.name.lower(),
        law=law,
        mass_kg=scene.mass_kg,
        friction=scene.friction,
        needed_n=pulled_n / (2.0 * scene.friction) if scene.friction else None,
        bump_at=scene.bump_at,
        broken=bool(report.get("broken", False)),
        lifted_m=float(report.get("highest_m", 0.0)),
        slip_m=float(report.get("slip_m", 0.0)),
        **quantities,
    )


def followed(trace: Trace) -> list[Signals]:
    """Return the signals after each frame of a trace."""
    now, signals_by_frame = NO_SIGNALS, []
    fast = trace.signals.get("acceleration")
    counts = np.zeros(0, int) if fast is None else np.searchsorted(fast.t_s, trace.t_s, side="right")
    begun = 0
    columns = {name: getattr(trace, name).tolist() for name in FOLLOWED}
    columns["dt_s"] = np.diff(trace.t_s, prepend=trace.t_s[:1]).tolist()
    for k in range(len(trace)):
        signals: Any = ()
        if fast is not None:
            rows = tuple(map(tuple, fast.values[begun : counts[k]].tolist()))
            begun = counts[k]
            signals = _Fast(Samples(float(trace.t_s[k]), int(begun), len(rows), rows))
        frame = Frame(**{name: column[k] for name, column in columns.items()})
        now = updated(FILTERS, now, Reading(frame, NO_PADS, signals))
        signals_by_frame.append(now)
    return signals_by_frame


class _Fast(NamedTuple):
    acceleration: Samples


def measured(trace: Trace, scene: TouchSettings) -> dict[str, Any]:
    """Return the quantities of a `TouchRow` that a trace has."""
    told = [
        (event.t_s, event.what, int(event.phase)) for event in trace.events if event.source == "controller"
    ]
    contacts = [t_s for t_s, what, _ in told if what == "both in contact"]
    if not contacts:
        return {}
    t_s, since_s = trace.t_s, contacts[0]
    weaker = np.minimum(trace.force_left_n, trace.force_right_n)
    contact = int(np.searchsorted(t_s, since_s))
    row: dict[str, Any] = {
        "contact_n": float(weaker[contact : np.searchsorted(t_s, since_s + 0.05) + 1].max()),
        "slips": sum(what == "slip" for _, what, _ in told),
        "limited": any(what == "force limit reached" for _, what, _ in told),
    }
    held = trace.phase == HOLD
    if not held.any():
        return row
    row["grip_n"], row["greatest_n"] = float(weaker[held][0]), float(weaker[held].max())
    row["deformed_m"] = float(trace.gap_m[contact] - trace.gap_m[held].min())
    signals, from_s = followed(trace), since_s + scene.disturbed_s
    kept = held & (t_s > from_s - 0.2) & (t_s < t_s[held][-1] - LAST_S)
    for key, low_n in (("slip_high_n", PUBLISHED_LOW_N), ("slip_wide_n", WIDE_LOW_N)):
        row[key] = _greatest(np.array([_disturbance(signal, low_n) for signal in signals]), kept)
    shocks = np.array([signal.acceleration.norm_m_s2 for signal in signals])
    down_s = since_s + scene.down_s
    if down_s == down_s:
        placing = (t_s > down_s + AROUND_S[0]) & (t_s < down_s + AROUND_S[1])
        lowering = held & (t_s > from_s - 0.1) & (t_s <= down_s + AROUND_S[0])
        row["shock_before_m_s2"] = _greatest(shocks, lowering)
        row["shock_at_m_s2"] = _greatest(shocks, placing) if held[placing].all() else None
        row["placed_s"] = next((t - down_s for t, what, _ in told if what == "place"), None)
    if scene.bump_at:
        edges = np.array([max(signal.edge_left.high_n, signal.edge_right.high_n) for signal in signals])
        bump_s, lasts_s = since_s + scene.bumped_s, BALL_M / scene.bump_m_s + scene.bump_touch_s + AROUND_S[1]
        bumped = held & (t_s > bump_s) & (t_s < bump_s + lasts_s)
        unbumped = held & (t_s <= bump_s)
        row["edge_before_n"], row["edge_at_n"] = _greatest(edges, unbumped), _greatest(edges, bumped)
        still = unbumped & (t_s > from_s)
        row["still_m_s2"], row["bump_m_s2"] = _greatest(shocks, still), _greatest(shocks, bumped)
    return row


def _greatest(values: NDArray[np.float64], where: NDArray[np.bool_]) -> float | None:
    return float(values[where].max()) if where.any() else None


def _disturbance(signals: Signals, low_n: float) -> float:
    """Return the high band (N) of the pads whose low band is below this force (N)."""
    pads = (signals.left, signals.right)
    return max((abs(pad.high_n) for pad in pads if abs(pad.low.y1) < low_n), default=0.0)
