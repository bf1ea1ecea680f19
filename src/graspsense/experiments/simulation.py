"""The error of features and force trace of a simulator, against the time of the same grasps."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve, field, frozen

from graspsense.core.components.roles import BatchBackend, Grasped, SimulationVariant
from graspsense.core.values.errors import ConfigError, counted, named
from graspsense.evaluation.intervals import Difference, RecognitionRate, percent
from graspsense.experiments.versions import measured_on
from graspsense.report.found_table import FoundTable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.features import Features
    from graspsense.core.values.trace import Trace

PEAK: Final = "peak force"
TRACE: Final = "force trace, rms"
SCENES: Final = (
    "odwalla:full_open",
    "odwalla:full_closed",
    "can:empty_open",
    "water:empty_closed",
    "toy",
    "block",
)
SCALES: Final[Mapping[str, float]] = {"m": 1e-3, "N": 1.0, "s": 0.05, "m/s": 1e-3, "N/s": 1.0}
"""Errors are relative to the value of the reference, or to this value of the same unit if that is larger."""
LEAST_S: Final = 0.2
"""A variant is run again until this much processor time is measured, so that the clock's resolution is negligible."""
LEAST_RUNS: Final = 3
"""It is run at least this often after the first time, since a single run may contain the collection of the garbage that
compiling left."""


@frozen(kw_only=True)
class VariantPoint:
    """The errors of one variant and its processor time, both measured on the same grasps.

    `seconds` is the processor time for one grasp, without set-up and compilation. `errors` are the largest errors over
    all grasps, by quantity, and infinite if a feature is missing that the reference has. `setup_s` is the additional
    time of the first grasps, for compiling or for loading compiled code. `failure` is the reason why there are no
    errors, or why grasps ended otherwise than in the reference. `recognised` is the rate with the sensors of the
    gripper (`simulation_recognition`), `behind` that of the reference less it; None where they are not measured.
    """

    method: str
    fidelity: str
    step: str
    role: str
    seconds: float = math.nan
    setup_s: float = math.nan
    errors: Mapping[str, float] = field(factory=dict)
    failure: str = ""
    recognised: RecognitionRate | None = None
    behind: Difference | None = None


@frozen(kw_only=True)
class SimulationTrade:
    """All variants of a simulated gripper, measured on the same grasps."""

    gripper: str
    scenes: tuple[str, ...]
    seeds: tuple[int, ...]
    quantities: tuple[str, ...]
    points: tuple[VariantPoint, ...]
    made: Mapping[str, str]


def simulation_table(trade: SimulationTrade) -> FoundTable:
    """Return the table: time, set-up, the largest error of each quantity, and recognition."""
    errors = (f"{name} [%]" for name in trade.quantities)
    return FoundTable(
        id="methods",
        title="Time and error of each method",
        header=(
            *("method", "fidelity", "step or accuracy", "time [ms]", "set-up [s]"),
            *(*errors, "recognised", "behind [points]", "note"),
        ),
        rows=tuple(_cells(point, trade.quantities) for point in trade.points),
        note=f"Scenes: {', '.join(trade.scenes)}; {counted(len(trade.seeds), 'seed')} each. Times are of one grasp. "
        "Errors are the largest ones, in percent of the reference. Behind is the rate of the reference less this one.",
        numbers=3,
    )


def _cells(point: VariantPoint, quantities: Sequence[str]) -> tuple[str, ...]:
    seconds, setup = (f"{v:.3g}" if math.isfinite(v) else "-" for v in (1e3 * point.seconds, point.setup_s))
    return (
        *(point.method, point.fidelity, point.step, seconds, setup),
        *(f"{100.0 * point.errors[name]:.1e}" if name in point.errors else "-" for name in quantities),
        percent(point.recognised.rate) if point.recognised else "-",
        point.behind.points if point.behind else "-",
        point.failure or ("the reference" if point.role == "reference" else ""),
    )


def trade_simulation(
    settings: Settings,
    *,
    scenes: Sequence[str] = SCENES,
    seeds: Sequence[int] = (1, 2),
    progress: Callable[[str, int, int], None] | None = None,
) -> SimulationTrade:
    """Grasp each scene with each seed in every variant that the gripper offers.

    Raises ConfigError if the gripper cannot trade accuracy for time, UnknownName for a scene it does not know.
    """
    backend = settings.gripper.create()
    variants = backend.variants() if isinstance(backend, BatchBackend) else ()
    if not variants:
        raise ConfigError(
            f"gripper {settings.gripper.component.qualified} has no accuracy to trade for time: choose a simulated "
            "one, as in gripper.type = 'sim'"
        )
    names = [scene for scene in scenes for _ in seeds]
    all_seeds = [seed for _ in scenes for seed in seeds]
    reference: list[_Measured] | None = None
    quantities: tuple[str, ...] = ()
    points: list[VariantPoint] = []
    in_turn = sorted(variants, key=lambda variant: variant.role != "reference")
    for k, variant in enumerate(in_turn):
        point = VariantPoint(
            method=variant.method, fidelity=variant.fidelity, step=variant.step, role=variant.role
        )
        what = f"{variant.method}, {variant.fidelity}, {variant.step}"
        tick = None if progress is None else partial(progress, what, k, len(in_turn))
        if tick is not None:
            tick()
        try:
            felt, seconds, setup = _measured(settings, variant, names, all_seeds, tick)
        except (ArithmeticError, ValueError, ConfigError) as error:
            # The reference comes first, so an unknown scene is already reported there.
            if reference is None:
                raise
            points.append(evolve(point, failure=named(error)))
            continue
        if reference is None:
            reference = felt
            quantities = (*felt[0][0].names, PEAK, TRACE)
        errors, failure = _errors(felt, reference)
        points.append(evolve(point, seconds=seconds, setup_s=setup, errors=errors, failure=failure))
    return SimulationTrade(
        gripper=settings.gripper.component.qualified,
        scenes=tuple(scenes),
        seeds=tuple(seeds),
        quantities=quantities,
        points=tuple(points),
        made=measured_on(),
    )


_Measured = tuple["Features", "NDArray[np.float64]"]
"""The features of a grasp, and the mean force of the pads over time."""


def _measured(
    settings: Settings,
    variant: SimulationVariant,
    scenes: Sequence[str],
    seeds: Sequence[int],
    tick: Callable[[], None] | None,
) -> tuple[list[_Measured], float, float]:
    """Return features and force of every grasp, the processor time of one, and the additional time of the first run."""
    ideal = settings.gripper.create().ideal_sensors
    backend = settings.gripper.component.create(evolve(settings.gripper.config, **ideal, **variant.settings))
    controller, feature_set = settings.controller.create(), settings.features.create()
    backend.expect_features(feature_set)

    def extract(trace: Trace) -> _Measured:
        return feature_set.extract(trace), 0.5 * (trace.force_left_n + trace.force_right_n)

    def run(which: slice) -> tuple[Sequence[Grasped], float]:
        began = time.process_time()
        done = backend.run_many(
            controller,
            scenes[which],
            seeds[which],
            run=settings.run,
            extract=extract,
            workers=1,
            progress=None if tick is None else lambda *_: tick(),
        )
        return done, time.process_time() - began

    with warnings.catch_warnings():
        # Some variants run in the interpreter on purpose; the warning about this is not needed.
        warnings.simplefilter("ignore")
        _, cold_s = run(slice(None))
        least, total, runs = math.inf, 0.0, 0
        while total < LEAST_S or runs < LEAST_RUNS:
            done, spent = run(slice(None))
            least, total, runs = min(least, spent), total + spent, runs + 1
    return [grasp.extracted for grasp in done], least / len(scenes), max(cold_s - least, 0.0)


def _errors(felt: Sequence[_Measured], reference: Sequence[_Measured]) -> tuple[dict[str, float], str]:
    """Return the largest error of each quantity, and why one of them is infinite."""
    worst: dict[str, float] = {}
    missing = ""
    for (measured, force), (true, true_force) in zip(felt, reference, strict=True):
        for name, unit in zip(true.names, true.units, strict=True):
            expected, value = true[name], measured[name]
            if math.isnan(expected):
                continue
            error = abs(value - expected) / max(abs(expected), SCALES.get(unit, 1.0))
            if math.isnan(error):
                missing, error = f"{name} is missing: {measured.reasons.get(name, '')}", math.inf
            worst[name] = max(worst.get(name, 0.0), error)
        n = min(len(force), len(true_force))
        true_peak, reached = (float(np.max(curve, initial=0.0)) for curve in (true_force, force))
        peak = max(true_peak, SCALES["N"])
        off = float(np.sqrt(np.mean((force[:n] - true_force[:n]) ** 2))) if n else math.inf
        worst[PEAK] = max(worst.get(PEAK, 0.0), abs(reached - true_peak) / peak)
        worst[TRACE] = max(worst.get(TRACE, 0.0), off / peak)
    return worst, missing or (
        "" if all(map(math.isfinite, worst.values())) else "no number in the force trace"
    )
