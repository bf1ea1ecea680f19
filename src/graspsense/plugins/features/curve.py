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

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import Channel, Feature, Features, FeatureSet, Trace, setting
from graspsense.plugins.features.contact_curve import (
    LEAST_SAMPLES,
    LOADED,
    UNRESOLVED,
    ContactCurve,
    Known,
    contact_curve,
    features_of,
    first_crossing,
)
from graspsense.plugins.features.contact_threshold import ContactThreshold

Floats = NDArray[np.float64]

LOADS: Final = (0.25, 0.5, 0.75)
"""Shares of the largest force at which the stiffness is measured, and of the loading at which its shape is."""
HALF_WINDOW: Final = 0.2
"""Half of the range of forces, as a share of the largest, over which a stiffness is a regression."""
POINTS: Final = np.linspace(0.0, 1.0, 17)
"""The points of a local regression, as shares of its time."""
RELAXED: Final = 0.05
"""Share of the largest force that must be lost in the hold for a time of relaxation."""


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


def _at_loads(name: str, unit: str, meaning: str, loads: Iterable[float] = LOADS) -> Iterator[Feature]:
    """Yield a feature at each of these shares, which stand behind its name and in its meaning."""
    for q in loads:
        yield Feature(f"{name}{100 * q:.0f}", unit, meaning.format(f"{100 * q:.0f} %"))


_AT_CONTACT: Final = (
    Feature("contact_gap", "m", "gap at the contact; needs a contact, like all others", width=True),
)
_LOADING: Final = (
    Feature("peak_force", "N", "largest force before the release"),
    Feature("compression", "m", "decrease of the gap from the contact to 95 % of the largest force"),
    Feature("loading_time", "s", "time from the contact to 95 % of the largest force"),
    Feature("loading_work", "J", "work done by one finger from the contact to 95 % of the largest force"),
)
_TRAVEL: Final = (
    *_at_loads(
        "stiffness_", "N/m", "slope of force over compression at {} of the largest force; needs a compression"
    ),
    Feature(
        "curvature",
        "1",
        "share by which the work of the loading is below that of a straight line: positive if the object stiffens; "
        "needs a compression",
    ),
    *_at_loads("load_x", "N", "force at {} of the compression of the loading; needs a compression"),
)
"""The features of the loading that need a compression."""
_COURSE: Final = tuple(_at_loads("load_t", "N", "force at {} of the time of the loading"))
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
    *_at_loads("hold_t", "N", "force at {} of the hold; needs a hold"),
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
    *_at_loads(
        "release_x",
        "N",
        "force in the release at {} of the compression at its beginning; needs a release",
        reversed(LOADS),
    ),
)
_PADS: Final = (
    Feature(
        "pad_difference",
        "1",
        "difference of the mean forces of both pads during the loading, divided by their sum; needs two pads",
    ),
)
_FEATURES: Final = (*_AT_CONTACT, *_LOADING, *_TRAVEL, *_COURSE, *_HOLD, *_RELEASE, *_PADS)
_OF_RISE: Final = (*_AT_CONTACT, *_LOADING[1:], *_TRAVEL, *_COURSE)
"""The features that depend on where in the rise of the force the contact is."""


def _all(features: Sequence[Feature], why: str) -> Known:
    """Return that all of these features are missing, and why."""
    return {feature.name: why for feature in features}


NAMES: Final = tuple(feature.name for feature in _FEATURES)
OF_GAP: Final = (
    *(feature.name for feature in _FEATURES if feature.unit in ("m", "J", "N/m")),
    *("curvature", "hysteresis"),
    *(f"{part}_x{100 * q:.0f}" for part in ("load", "release") for q in LOADS),
)
"""The features that need a gap."""


class CurveFeatures(FeatureSet[CurveConfig]):
    """Extracts the features of loading, hold and release."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = _FEATURES

    def extract(self, trace: Trace) -> Features:
        """Return the features; one whose stretch the trace lacks is NaN with the reason."""
        curve = contact_curve(trace, self.config.contact_force_n)
        if isinstance(curve, str):
            known = _all(_FEATURES, curve)
        else:
            known = {"contact_gap": curve.contact_gap_m, **self._squeeze(curve)}
            if not curve.resolved:
                known |= _all(_OF_RISE, UNRESOLVED)
        return features_of(self, known, trace, OF_GAP)

    def _squeeze(self, curve: ContactCurve) -> Known:
        """Return everything after the contact."""
        gripped = curve.t_s <= curve.end_s
        if np.count_nonzero(gripped) < LEAST_SAMPLES:
            return _all(_FEATURES[1:], "fewer than three samples from the contact to the release")
        t_s = curve.t_s[gripped]
        force = curve.mean_force(t_s, self.config.window_s)
        peak = float(force.max())
        loaded_s = first_crossing(t_s, force, LOADED * peak)
        if loaded_s is None or not loaded_s > t_s[0]:
            return _all(_FEATURES[1:], "the force does not rise after the contact")
        loading = _Loading(curve=curve, t_s=t_s, force=force, peak_n=peak, end_s=loaded_s)
        return {**self._loading(loading), **self._hold(loading), **self._release(curve)}

    def _loading(self, loading: _Loading) -> Known:
        curve, start, end = loading.curve, loading.t_s[0], loading.end_s
        travel, work = curve.compression(end), float(curve.work(np.array([end]))[0])
        known: Known = {
            "peak_force": loading.peak_n,
            "compression": travel,
            "loading_time": float(end - start),
            "loading_work": work,
            "pad_difference": _difference(loading),
            **self._shape(loading, travel),
        }
        if travel < self.config.least_travel_m:
            why = f"the fingers closed by {travel * 1e3:.2g} mm only, below least_travel_m"
            return known | _all(_TRAVEL, why)
        start_n, end_n = np.interp((start, end), curve.t_s, curve.force_n)
        straight = 0.5 * (end_n - start_n) * travel
        known["curvature"] = (
            float(1.0 - (work - start_n * travel) / straight)
            if straight > 0.0
            else "the force does not rise in the loading"
        )
        low, high = (
            [
                first_crossing(loading.t_s, loading.force, (q + side * HALF_WINDOW) * loading.peak_n)
                for q in LOADS
            ]
            for side in (-1.0, 1.0)
        )
        stiffnesses = (f"stiffness_{100 * q:.0f}" for q in LOADS)
        return known | dict(zip(stiffnesses, self._slopes(curve, low, high), strict=True))

    def _shape(self, loading: _Loading, travel: float) -> Known:
        """Return the forces at shares of the time and of the compression of the loading."""
        curve, start = loading.curve, loading.t_s[0]
        times_s = {f"load_t{100 * q:.0f}": float(start + q * (loading.end_s - start)) for q in LOADS}
        if travel >= self.config.least_travel_m:
            compression = curve.compression_m[: len(loading.t_s)]
            for q in LOADS:
                reached = first_crossing(loading.t_s, compression, q * travel)
                assert reached is not None, "the compression at the end of the loading is larger"
                times_s[f"load_x{100 * q:.0f}"] = reached
        forces = curve.mean_force(np.array(list(times_s.values())), self.config.window_s)
        return dict(zip(times_s, forces.tolist(), strict=True))

    def _slopes(
        self, curve: ContactCurve, starts: Sequence[float | None], ends: Sequence[float | None]
    ) -> list[float | str]:
        """Return the regression of force on compression between each pair of times, or the reason why there is none."""
        start, end = np.array(starts, dtype=np.float64), np.array(ends, dtype=np.float64)
        t_s = start[:, np.newaxis] + (end - start)[:, np.newaxis] * POINTS
        x = np.interp(t_s, curve.t_s, curve.compression_m)
        force = np.interp(t_s, curve.t_s, curve.force_n)
        travels = x.max(axis=1) - x.min(axis=1)
        apart = x - x.mean(axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes = (apart * force).sum(axis=1) / (apart * apart).sum(axis=1)
        results: list[float | str] = slopes.tolist()
        for k, travel in enumerate(travels.tolist()):
            if travel != travel:
                results[k] = "the force does not change so far"
            elif travel < self.config.least_travel_m:
                results[k] = f"the fingers moved by {travel * 1e3:.2g} mm there, below least_travel_m"
        return results

    def _hold(self, loading: _Loading) -> Known:
        curve, window = loading.curve, self.config.window_s
        duration = curve.end_s - loading.end_s
        if duration < 2.0 * window:
            after = "the release" if curve.released else "the end of the trace"
            return _all(_HOLD, f"no hold: {after} follows {max(duration, 0.0):.3g} s after the loading")
        times_s = loading.end_s + np.array((*LOADS, 1.0)) * duration
        *held, last = curve.mean_force(times_s, window).tolist()
        lost = loading.peak_n - last
        known: Known = dict(zip((f"hold_t{100 * q:.0f}" for q in LOADS), held, strict=True))
        known["relaxation"] = lost / loading.peak_n
        known["creep"] = curve.compression(curve.end_s) - curve.compression(loading.end_s)
        known["relaxation_time"] = f"the force lost less than {100 * RELAXED:.0f} % of its largest value"
        if lost >= RELAXED * loading.peak_n:
            top = int(loading.force.argmax())
            t_s = np.append(loading.t_s[top:], curve.end_s)
            above = np.append(loading.force[top:], last) - last
            known["relaxation_time"] = float((0.5 * (above[1:] + above[:-1]) * np.diff(t_s)).sum() / lost)
        return known

    def _release(self, curve: ContactCurve) -> Known:
        if not curve.released:
            return _all(_RELEASE, "the trace ends before the release")
        after = curve.t_s >= curve.end_s
        t_s = curve.t_s[after]
        let_go = first_crossing(t_s, -curve.lowest_n[after], -self.config.contact_force_n)
        if let_go is None:
            return _all(_RELEASE, "the trace ends before the pads lose contact in the release")
        done, left = curve.work(np.array([curve.end_s, let_go])).tolist()
        begin_n = float(np.interp(curve.end_s, curve.t_s, curve.force_n))
        high = first_crossing(t_s, -curve.force_n[after], -LOADS[2] * begin_n)
        low = first_crossing(t_s, -curve.force_n[after], -LOADS[0] * begin_n)
        known: Known = {
            "hysteresis": left / done if done > 0.0 else "no work was done on the object",
            "residual_compression": curve.compression(let_go),
            "unloading_stiffness": self._slopes(curve, [high], [low])[0],
        }
        begin = curve.compression(curve.end_s)
        for q in LOADS:
            reached = None
            if begin >= self.config.least_travel_m:
                reached = first_crossing(t_s, -curve.compression_m[after], -q * begin)
            known[f"release_x{100 * q:.0f}"] = (
                "the fingers did not open so far, or were not closed further"
                if reached is None
                else float(np.interp(reached, curve.t_s, curve.force_n))
            )
        return known


@frozen(kw_only=True, eq=False)
class _Loading:
    """The samples from the contact to the release, the mean force at them, and where the loading ends."""

    curve: ContactCurve
    t_s: Floats
    force: Floats
    peak_n: float
    end_s: float


def _difference(loading: _Loading) -> float | str:
    """Return the difference of the mean forces of both pads in the loading as a share of their sum."""
    curve = loading.curve
    if len(curve.pads) < 2:
        return "only one pad touched, or gives numbers"
    t_s = loading.t_s[loading.t_s <= loading.end_s]
    pads = curve.pads[:, : len(t_s)]
    left, right = (0.5 * (pads[:, 1:] + pads[:, :-1]) * np.diff(t_s)).sum(axis=1).tolist()
    total = left + right
    return abs(left - right) / total if total > 0.0 else "the pads felt nothing in the loading"
