"""What acceleration and pads feel while a held thing is shaken, and after that.

Chitta, Sturm, Piccoli and Burgard ("Tactile Sensing for Mobile Manipulation", IEEE T-RO, 2011) roll a held bottle, and
detect what moves in it by the high-frequency component of the tactile signals. H.-J. Huang and others ("Understanding
Dynamic Tactile Sensing for Liquid Property Estimation", 2022) use frequency and decay of the oscillation of a liquid
after a disturbance. Bands and equations here are ours.

The shake lasts from the first to the last tick of the hold in which the channel `shake`, the displacement of the
gripper, exceeds 2 % of its largest value; what follows up to the release is after it. The signals are the axes of the
channel `acceleration`, and of the pads F = force_left - force_right, which moves the thing along the closing direction.
With n samples x_k at the rate r, less their mean, and Hann's window w_k, density and rms in a band are

    S(f) = 2 |sum x_k w_k exp(-2 pi i f k / r)|^2 / (r sum w_k^2)
    rms^2 = sum of S(f) r / n over the axes and over f_1 <= f < f_2

so that a sine of the amplitude A has the rms A / sqrt 2 in its band. The peak is the frequency from 1 to 50 Hz of the
largest density after the shake. The decay is the slope of -ln rms of the band low over four equal stretches after the
shake. moved_mass is the rms of the pads over that of the acceleration, both of the band low during the shake: of a
shake along the closing direction, the mass that the pads move. It is missing where the shake itself is not in that
band, an rms where its band has fewer than three lines of the spectrum, and all of a signal where samples are missing.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import HOLD, Channel, Feature, Features, FeatureSet, Trace, setting

Floats = NDArray[np.float64]

BANDS_HZ: Final = {"low": (1.0, 10.0), "mid": (10.0, 50.0), "high": (50.0, 500.0)}
PEAK_HZ: Final = (1.0, 50.0)
PADDED: Final = 8
"""The spectrum whose peak is sought is that of so many times the samples, most of them zero."""
STRETCHES: Final = 4
LINES: Final = 3
"""Fewest lines of a spectrum in a band that show its rms."""
LONGEST_HOLE_S: Final = 0.05
"""A time without samples that is longer (s), and than so many usual ones, hides what is in the band low."""
HOLE_STEPS: Final = 5.0
SLOW_SHARE: Final = 0.5
"""Least share of the shake in the band low with which forces and accelerations there are those of the shake."""
MOVED_SHARE: Final = 0.02
LEAST_SAMPLES: Final = 16
SIGNALS: Final = {"acceleration": "m/s2", "pads": "N"}
_NEEDS: Final = "needs a shake in the hold"


def _declared() -> tuple[Feature, ...]:
    features = []
    for signal, unit in SIGNALS.items():
        for when, words in (("", "during"), ("_after", "after")):
            for band, (low, high) in BANDS_HZ.items():
                meaning = f"rms from {low:g} to {high:g} Hz {words} the shake; {_NEEDS}"
                features.append(Feature(f"{signal}_{band}{when}", unit, meaning))
        features.append(
            Feature(f"{signal}_peak", "Hz", f"frequency of the largest density after the shake; {_NEEDS}")
        )
        features.append(
            Feature(f"{signal}_decay", "1/s", f"rate at which it fades after the shake; {_NEEDS}")
        )
    return (*features, Feature("moved_mass", "kg", f"force of the pads over the acceleration; {_NEEDS}"))


@frozen(kw_only=True)
class ShakeConfig:
    """What counts as a shake, and how long it must be held after it."""

    least_shake_m: float = setting(
        default=5e-4,
        unit="m",
        above=0.0,
        plausible=(1e-5, 0.1),
        meaning="Displacement of the gripper from which on it is shaken.",
    )
    least_after_s: float = setting(
        default=0.5,
        unit="s",
        above=0.0,
        plausible=(0.1, 60.0),
        meaning="Time in the hold after the shake, without which the features of that time are missing.",
    )


class Signal(NamedTuple):
    """Evenly spaced samples (n, axes), and how many there are in a second."""

    values: Floats
    rate_hz: float


class ShakeFeatures(FeatureSet[ShakeConfig]):
    """Extracts bands, peaks and decays of acceleration and pads around a shake."""

    requires = (Channel("force_left", "N"), Channel("force_right", "N"), Channel("shake", "m"))
    features = _declared()

    def extract(self, trace: Trace) -> Features:
        """Return the features; all are missing without a shake, and those of a signal where that is missing."""
        if (times := self._times(trace)) is None:
            return self.undefined(
                f"no channel `shake` says that the gripper moved by {self.config.least_shake_m * 1e3:g} mm in the hold"
            )
        begin_s, end_s, last_s = times
        values: dict[str, float | str] = {}
        for name in SIGNALS:
            during, after = _signal(trace, name, begin_s, end_s), _signal(trace, name, end_s, last_s)
            if last_s - end_s < self.config.least_after_s:
                after = f"the hold ends {last_s - end_s:.2g} s after the shake"
            for when, signal in (("", during), ("_after", after)):
                for band in BANDS_HZ:
                    values[f"{name}_{band}{when}"] = _rms_or_reason(signal, band)
            values[f"{name}_peak"] = after if isinstance(after, str) else peak_hz(after)
            values[f"{name}_decay"] = after if isinstance(after, str) else decay_1_s(after)
        force, acceleration = values["pads_low"], values["acceleration_low"]
        values["moved_mass"] = "the pads or the acceleration are missing, or not moved"
        shake = _signal(trace, "shake", begin_s, end_s)
        if isinstance(shake, Signal) and rms(shake, *BANDS_HZ["low"]) < SLOW_SHARE * shake.values.std():
            values["moved_mass"] = "it is shaken faster or slower than the band low"
        elif isinstance(force, float) and isinstance(acceleration, float) and acceleration:
            values["moved_mass"] = force / acceleration
        reasons = {name: reason for name, reason in values.items() if isinstance(reason, str)}
        return self.result(
            {name: value for name, value in values.items() if not isinstance(value, str)}, reasons
        )

    def _times(self, trace: Trace) -> tuple[float, float, float] | None:
        """Return when the shake begins and ends, and the hold ends; None without a shake."""
        shake = trace.signals.get("shake")
        held = np.flatnonzero(trace.phase == HOLD)
        if not isinstance(shake, np.ndarray) or len(held) == 0 or trace.units["t"] != "s":
            return None
        moved_m = np.abs(np.nan_to_num(shake[held]))
        if not moved_m.max() >= self.config.least_shake_m:
            return None
        shaken = held[moved_m > MOVED_SHARE * moved_m.max()]
        begin_s, end_s, last_s = trace.t_s[[shaken[0], shaken[-1], held[-1]]].tolist()
        return begin_s, end_s, last_s


def _signal(trace: Trace, name: str, begin_s: float, end_s: float) -> Signal | str:
    """Return a signal from one time to another, evenly spaced, or the reason why there is none."""
    t_s: Any
    values: Any
    if name in ("pads", "shake"):
        pads = trace.force_left_n - trace.force_right_n
        t_s, values = trace.t_s, (pads if name == "pads" else trace.signals[name])[:, np.newaxis]
    else:
        samples = trace.signals.get(name)
        t_s, values = getattr(samples, "t_s", None), getattr(samples, "values", None)
        if t_s is None or values is None:
            return f"there is no fast channel `{name}`"
    within = (t_s > begin_s) & (t_s <= end_s) & np.isfinite(values).all(axis=1)
    t_s, values = t_s[within], values[within]
    steps = np.diff(t_s)
    if len(steps) and steps.max() > max(LONGEST_HOLE_S, HOLE_STEPS * float(np.median(steps))):
        return f"{name}: no samples for {steps.max():.2g} s there"
    # What is repeated between two images of the pads is not a sample.
    new = np.append(len(values) > 0, (np.diff(values, axis=0) != 0.0).any(axis=1))[: len(values)]
    t_s, values = t_s[new], values[new]
    if len(t_s) < LEAST_SAMPLES or not t_s[-1] > t_s[0]:
        return f"{name}: fewer than {LEAST_SAMPLES} different samples there"
    even_s = np.linspace(t_s[0], t_s[-1], len(t_s))
    even = np.stack([np.interp(even_s, t_s, column) for column in values.T], axis=1)
    return Signal(even - even.mean(axis=0), (len(t_s) - 1) / float(t_s[-1] - t_s[0]))


def density(signal: Signal, padded: int = 1) -> tuple[Floats, Floats]:
    """Return frequencies (Hz), and the sum over the axes of the densities (square of the unit, per Hz)."""
    n = len(signal.values)
    window = np.hanning(n + 1)[:-1]
    spectrum = np.fft.rfft(signal.values * window[:, np.newaxis], n * padded, axis=0)
    power: Floats = 2.0 * (np.abs(spectrum) ** 2).sum(axis=1) / (signal.rate_hz * (window**2).sum())
    return np.fft.rfftfreq(n * padded, 1.0 / signal.rate_hz).astype(np.float64), power


def rms(signal: Signal, low_hz: float, high_hz: float) -> float:
    """Return the rms of a signal in a band."""
    frequency, power = density(signal)
    of_band = power[(frequency >= low_hz) & (frequency < high_hz)]
    return float(np.sqrt(of_band.sum() * signal.rate_hz / len(signal.values)))


def _rms_or_reason(signal: Signal | str, band: str) -> float | str:
    if isinstance(signal, str):
        return signal
    low_hz, high_hz = BANDS_HZ[band]
    if (seconds := len(signal.values) / signal.rate_hz) < LINES / (high_hz - low_hz):
        return f"{seconds:.2g} s are too short for {low_hz:g} to {high_hz:g} Hz"
    if 0.5 * signal.rate_hz < 0.95 * high_hz:
        return f"{signal.rate_hz:.3g} samples a second do not show {low_hz:g} to {high_hz:g} Hz"
    return rms(signal, low_hz, high_hz)


def peak_hz(signal: Signal) -> float:
    """Return the frequency of the largest density."""
    frequency, power = density(signal, PADDED)
    within = (frequency >= PEAK_HZ[0]) & (frequency <= min(PEAK_HZ[1], 0.5 * signal.rate_hz))
    return float(frequency[within][power[within].argmax()]) if within.any() else 0.0


def decay_1_s(signal: Signal) -> float | str:
    """Return the rate at which the band low fades, or the reason why there is none."""
    parts = np.array_split(signal.values, STRETCHES)
    left = [rms(Signal(part - part.mean(axis=0), signal.rate_hz), *BANDS_HZ["low"]) for part in parts]
    if not min(left) > 0.0:
        return "nothing is left of it after the shake"
    middle_s = (np.arange(STRETCHES) + 0.5) * len(signal.values) / STRETCHES / signal.rate_hz
    return float(-np.polyfit(middle_s, np.log(left), 1)[0])
