"""Features of the whole force curve of a grasp: stiffness, its change, work, relaxation, hysteresis, and its shape.

Every feature is an integral, a crossing or a local regression over the force as a function of compression and time
(`contact_curve`). The spacing of the samples, the phases of a controller and a second pad are not needed. A feature
that needs a hold or a release is missing where the trace has none.

The compression is the decrease of the gap since the contact, x. The force F is averaged over `window_s`, so that the
noise of a pad does not raise its largest value. The *loading* ends when F first reaches 95 % of its largest value
before the release, the *hold* lasts from there to the release, and the *release* until a pad falls below the contact
force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import (
    Channel,
    Feature,
    Features,
    FeatureSet,
    Trace,
    missing,
    setting,
)
from graspsense.plugins.features.contact_curve import (
    ContactCurve,
    contact_curve,
    first_crossing,
    samples_of,
    without_gap,
)
from graspsense.plugins.features.contact_threshold import ContactThreshold

Floats = NDArray[np.float64]

LOADED: Final = 0.95
"""Share of the largest force at which the loading ends; a plateau reaches the largest force itself by noise only."""
LOADS: Final = (0.25, 0.5, 0.75)
"""Shares of the largest force at which the stiffness is measured, and of the loading at which its shape is."""
HALF_WINDOW: Final = 0.2
"""Half of the range of forces, as a share of the largest, over which a stiffness is a regression."""
POINTS: Final = np.linspace(0.0, 1.0, 17)
"""The points of a local regression, as shares of its time."""
RELAXED: Final = 0.05
"""Share of the largest force that must be lost in the hold for a time of relaxation."""
LEAST_SAMPLES: Final = 3


@frozen(kw_only=True)
class CurveConfig(ContactThreshold):
    """The threshold of contact, and what is too short to measure."""

    window_s: float = setting(
        default=0.05,
        unit="s",
        above=0.0,
        plausible=(0.001, 1.0),
        meaning="Time over which forces are averaged; a hold is at least twice as long.",
    )
    least_travel_m: float = setting(
        default=2e-5,
        unit="m",
        above=0.0,
        plausible=(1e-7, 0.01),
        meaning="Compression below which there is no stiffness and no shape, well above the resolution of the gap.",
    )


_AT_CONTACT: Final = (
    Feature("contact_gap", "m", "gap at the contact; needs a contact, like all others", width=True),
)
_LOADING: Final = (
    Feature("peak_force", "N", "largest force before the release"),
    Feature("compression", "m", "decrease of the gap from the contact to 95 % of the largest force"),
    Feature("loading_time", "s", "time from the contact to 95 % of the largest force"),
    Feature("loading_work", "J", "work done by one finger from the contact to 95 % of the largest force"),
)
_STIFFNESS: Final = tuple(
    Feature(
        f"stiffness_{100 * q:.0f}",
        "N/m",
        f"slope of force over compression at {100 * q:.0f} % of the largest force; needs a compression",
    )
    for q in LOADS
)
_SHAPE: Final = (
    Feature(
        "curvature",
        "1",
        "share by which the work of the loading is below that of a straight line: positive if the object stiffens; "
        "needs a compression",
    ),
    *(
        Feature(
            f"load_x{100 * q:.0f}",
            "N",
            f"force at {100 * q:.0f} % of the compression of the loading; needs a compression",
        )
        for q in LOADS
    ),
    *(
        Feature(f"load_t{100 * q:.0f}", "N", f"force at {100 * q:.0f} % of the time of the loading")
        for q in LOADS
    ),
)
_HOLD: Final = (
    Feature(
        "relaxation", "1", "share of the largest force that is lost at the end of the hold; needs a hold"
    ),
    Feature(
        "relaxation_time",
        "s",
        "time constant of that loss: its integral over the hold, divided by it; needs a loss of 5 % in a hold",
    ),
    Feature("creep", "m", "decrease of the gap during the hold; needs a hold"),
    *(
        Feature(f"hold_t{100 * q:.0f}", "N", f"force at {100 * q:.0f} % of the hold; needs a hold")
        for q in LOADS
    ),
)
_RELEASE: Final = (
    Feature(
        "hysteresis",
        "1",
        "share of the work of loading and hold that the release does not return; needs a release",
    ),
    Feature(
        "residual_compression",
        "m",
        "compression at which the first pad loses contact in the release; needs a release",
    ),
    Feature(
        "unloading_stiffness",
        "N/m",
        "slope of force over compression from 75 % to 25 % of the force where the release begins; needs a release",
    ),
    *(
        Feature(
            f"release_x{100 * q:.0f}",
            "N",
            f"force in the release at {100 * q:.0f} % of the compression at its beginning; needs a release",
        )
        for q in reversed(LOADS)
    ),
)
_PADS: Final = (
    Feature(
        "pad_difference",
        "1",
        "difference of the mean forces of both pads during the loading, divided by their sum; needs two pads",
    ),
)
_FEATURES: Final = (*_AT_CONTACT, *_LOADING, *_STIFFNESS, *_SHAPE, *_HOLD, *_RELEASE, *_PADS)


def _names(features: tuple[Feature, ...]) -> tuple[str, ...]:
    return tuple(feature.name for feature in features)


NAMES: Final = _names(_FEATURES)
TRAVEL_NAMES: Final = (*_names(_STIFFNESS), "curvature", *(f"load_x{100 * q:.0f}" for q in LOADS))
"""The features of the loading that need a compression."""
OF_GAP: Final = (
    *(feature.name for feature in _FEATURES if feature.unit in ("m", "J", "N/m")),
    *("curvature", "hysteresis"),
    *(f"{part}_x{100 * q:.0f}" for part in ("load", "release") for q in LOADS),
)
"""The features that need a gap."""


class _Found:
    """Collects values, and reasons for features that are missing."""

    def __init__(self) -> None:
        self.values: dict[str, float] = {}
        self.reasons: dict[str, str] = {}

    def add(self, name: str, value: float | None, reason: str) -> None:
        """Add a value; the reason is used if it is None or not finite."""
        if value is None or not np.isfinite(value):
            self.reasons[name] = reason
        else:
            self.values[name] = float(value)


class CurveFeatures(FeatureSet[CurveConfig]):
    """Extracts the features of loading, hold and release."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = _FEATURES

    def extract(self, trace: Trace) -> Features:
        """Return the features; one whose stretch the trace lacks is NaN with the reason."""
        contact_force_n = self.config.contact_force_n
        samples = samples_of(trace, contact_force_n)
        curve = samples if isinstance(samples, str) else contact_curve(samples, contact_force_n)
        measured = _Found()
        if isinstance(curve, str):
            measured.reasons = missing(NAMES, curve)
        else:
            measured.add("contact_gap", curve.contact_gap_m, "the gap is not a number")
            self._squeeze(curve, measured)
        return without_gap(trace, self.result(measured.values, measured.reasons, trace.units), OF_GAP)

    def _squeeze(self, curve: ContactCurve, measured: _Found) -> None:
        """Add everything after the contact."""
        gripped = curve.t_s <= curve.end_s
        if np.count_nonzero(gripped) < LEAST_SAMPLES:
            measured.reasons |= missing(NAMES[1:], "fewer than three samples from the contact to the release")
            return
        t_s = curve.t_s[gripped]
        force = curve.mean_force(t_s, self.config.window_s)
        peak = float(force.max())
        loaded_s = first_crossing(t_s, force, LOADED * peak)
        if loaded_s is None or not loaded_s > t_s[0]:
            measured.reasons |= missing(NAMES[1:], "the force does not rise after the contact")
            return
        loading = _Loading(curve=curve, t_s=t_s, force=force, peak_n=peak, end_s=loaded_s)
        self._loading(loading, measured)
        self._hold(loading, measured)
        self._release(loading, measured)

    def _loading(self, loading: _Loading, measured: _Found) -> None:
        curve, start, end = loading.curve, loading.t_s[0], loading.end_s
        travel = curve.compression(end)
        duration = end - start
        measured.values |= {
            "peak_force": loading.peak_n,
            "compression": travel,
            "loading_time": float(duration),
            "loading_work": float(curve.work(np.array([end]))[0]),
        }
        self._shape(loading, travel, measured)
        self._difference(loading, measured)
        if travel < self.config.least_travel_m:
            why = f"the fingers closed by {travel * 1e3:.2g} mm only, below least_travel_m"
            measured.reasons |= missing(TRAVEL_NAMES, why)
            return
        start_n, end_n = np.interp((start, end), curve.t_s, curve.force_n)
        above = measured.values["loading_work"] - start_n * travel
        straight = 0.5 * (end_n - start_n) * travel
        measured.add(
            "curvature",
            1.0 - above / straight if straight > 0.0 else None,
            "the force does not rise in the loading",
        )
        self._stiffness(loading, measured)

    def _shape(self, loading: _Loading, travel: float, measured: _Found) -> None:
        """Add the forces at shares of the time and of the compression of the loading."""
        curve, start = loading.curve, loading.t_s[0]
        times_s = {f"load_t{100 * q:.0f}": float(start + q * (loading.end_s - start)) for q in LOADS}
        if travel >= self.config.least_travel_m:
            compression = curve.compression_m[: len(loading.t_s)]
            for q in LOADS:
                reached = first_crossing(loading.t_s, compression, q * travel)
                assert reached is not None, "the compression at the end of the loading is larger"
                times_s[f"load_x{100 * q:.0f}"] = reached
        forces = curve.mean_force(np.array(list(times_s.values())), self.config.window_s)
        measured.values |= dict(zip(times_s, forces.tolist(), strict=True))

    def _stiffness(self, loading: _Loading, measured: _Found) -> None:
        """Add the slope of force over compression around each share of the largest force."""
        low, high = (
            [
                first_crossing(loading.t_s, loading.force, (q + side * HALF_WINDOW) * loading.peak_n)
                for q in LOADS
            ]
            for side in (-1.0, 1.0)
        )
        slopes = self._slopes(loading.curve, low, high)
        for q, (slope, reason) in zip(LOADS, slopes, strict=True):
            measured.add(f"stiffness_{100 * q:.0f}", slope, reason)

    def _slopes(
        self, curve: ContactCurve, starts: Sequence[float | None], ends: Sequence[float | None]
    ) -> list[tuple[float | None, str]]:
        """Return the regression of force on compression between each pair of times, or the reason why there is none."""
        start, end = np.array(starts, dtype=np.float64), np.array(ends, dtype=np.float64)
        t_s = start[:, np.newaxis] + (end - start)[:, np.newaxis] * POINTS
        x = np.interp(t_s, curve.t_s, curve.compression_m)
        force = np.interp(t_s, curve.t_s, curve.force_n)
        travels = x.max(axis=1) - x.min(axis=1)
        apart = x - x.mean(axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes = (apart * force).sum(axis=1) / (apart * apart).sum(axis=1)
        results: list[tuple[float | None, str]] = []
        for slope, travel in zip(slopes.tolist(), travels.tolist(), strict=True):
            if travel != travel:
                results.append((None, "the force does not change so far"))
            elif travel < self.config.least_travel_m:
                why = f"the fingers moved by {travel * 1e3:.2g} mm there, below least_travel_m"
                results.append((None, why))
            else:
                results.append((slope, ""))
        return results

    def _difference(self, loading: _Loading, measured: _Found) -> None:
        curve = loading.curve
        if len(curve.pads) < 2:
            measured.reasons["pad_difference"] = "only one pad touched, or gives numbers"
            return
        t_s = loading.t_s[loading.t_s <= loading.end_s]
        pads = curve.pads[:, : len(t_s)]
        left, right = (0.5 * (pads[:, 1:] + pads[:, :-1]) * np.diff(t_s)).sum(axis=1).tolist()
        total = left + right
        measured.add(
            "pad_difference",
            abs(left - right) / total if total > 0.0 else None,
            "the pads felt nothing in the loading",
        )

    def _hold(self, loading: _Loading, measured: _Found) -> None:
        curve, window = loading.curve, self.config.window_s
        duration = curve.end_s - loading.end_s
        if duration < 2.0 * window:
            after = "the release" if curve.released else "the end of the trace"
            why = f"no hold: {after} follows {max(duration, 0.0):.3g} s after the loading"
            measured.reasons |= missing(_names(_HOLD), why)
            return
        times_s = loading.end_s + np.array((*LOADS, 1.0)) * duration
        *held, last = curve.mean_force(times_s, window).tolist()
        for q, value in zip(LOADS, held, strict=True):
            measured.values[f"hold_t{100 * q:.0f}"] = value
        lost = loading.peak_n - last
        measured.values["relaxation"] = lost / loading.peak_n
        measured.values["creep"] = curve.compression(curve.end_s) - curve.compression(loading.end_s)
        if lost < RELAXED * loading.peak_n:
            measured.reasons["relaxation_time"] = (
                f"the force lost less than {100 * RELAXED:.0f} % of its largest value"
            )
            return
        top = int(loading.force.argmax())
        t_s = np.append(loading.t_s[top:], curve.end_s)
        above = np.append(loading.force[top:], last) - last
        measured.values["relaxation_time"] = float(
            (0.5 * (above[1:] + above[:-1]) * np.diff(t_s)).sum() / lost
        )

    def _release(self, loading: _Loading, measured: _Found) -> None:
        curve, names = loading.curve, _names(_RELEASE)
        if not curve.released:
            measured.reasons |= missing(names, "the trace ends before the release")
            return
        after = curve.t_s >= curve.end_s
        t_s = curve.t_s[after]
        let_go = first_crossing(t_s, -curve.lowest_n[after], -self.config.contact_force_n)
        if let_go is None:
            measured.reasons |= missing(names, "the trace ends before the pads lose contact in the release")
            return
        done, left = curve.work(np.array([curve.end_s, let_go])).tolist()
        why = "no work was done on the object"
        measured.add("hysteresis", left / done if done > 0.0 else None, why)
        measured.values["residual_compression"] = curve.compression(let_go)
        begin_n = float(np.interp(curve.end_s, curve.t_s, curve.force_n))
        high = first_crossing(t_s, -curve.force_n[after], -LOADS[2] * begin_n)
        low = first_crossing(t_s, -curve.force_n[after], -LOADS[0] * begin_n)
        ((slope, reason),) = self._slopes(curve, [high], [low])
        measured.add("unloading_stiffness", slope, reason)
        begin = curve.compression(curve.end_s)
        for q in LOADS:
            reached = None
            if begin >= self.config.least_travel_m:
                reached = first_crossing(t_s, -curve.compression_m[after], -q * begin)
            force = None if reached is None else float(np.interp(reached, curve.t_s, curve.force_n))
            measured.add(
                f"release_x{100 * q:.0f}",
                force,
                "the fingers did not open so far, or were not closed further",
            )


@frozen(kw_only=True, eq=False)
class _Loading:
    """The samples from the contact to the release, the mean force at them, and where the loading ends."""

    curve: ContactCurve
    t_s: Floats
    force: Floats
    peak_n: float
    end_s: float
