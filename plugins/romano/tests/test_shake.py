"""The features of a shake, against signals whose bands, peak, decay and mass are known, and on simulated bottles."""

import math

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import printed
from hypothesis import given
from hypothesis import strategies as st
from traces import made_trace

from graspsense import load_pipeline
from graspsense.plugin_api import HOLD, SQUEEZE, create
from graspsense.testing_api import SampleTrace
from graspsense_romano.shake import Signal, decay_1_s, peak_hz, rms

RATE_HZ, FAST_HZ = 1000, 3000
SHAKEN_S, HELD_S = (1.0, 2.0), 3.0
CARRIED_KG = 0.3


def grasp(
    acceleration=True, shake=True, held_s=HELD_S, pad_hz=RATE_HZ, shake_hz=3.0, until_s=2.0, hole_s=None
):
    """Return a grasp of 3 s that is shaken at 3 Hz from 1 to 2 s, and wobbles at 5 Hz after that, fading with 2 1/s.

    Of the acceleration, the samples in the time `hole_s` are missing.
    """
    t_s = np.arange(int(HELD_S * RATE_HZ)) / RATE_HZ
    fast_s = np.arange(int(HELD_S * FAST_HZ)) / FAST_HZ
    if hole_s is not None:
        fast_s = fast_s[(fast_s < hole_s[0]) | (fast_s > hole_s[1])]

    def moved(t_s):
        return 2.0 * np.sin(2 * np.pi * shake_hz * t_s) * ((t_s >= SHAKEN_S[0]) & (t_s <= until_s))

    def wobble(t_s):
        since_s = np.maximum(t_s - until_s, 0.0)
        return np.exp(-2.0 * since_s) * np.sin(2 * np.pi * 5.0 * since_s)

    imaged_s = np.floor(t_s * pad_hz) / pad_hz
    difference_n = CARRIED_KG * moved(imaged_s) + wobble(imaged_s)
    signals = {}
    if acceleration:
        axes = np.tile((0.0, 0.0, 9.81), (len(fast_s), 1))
        axes[:, 0] = moved(fast_s) + wobble(fast_s)
        signals["acceleration"] = SampleTrace(t_s=fast_s, values=axes)
    if shake:
        signals["shake"] = 0.008 * moved(t_s)
    rows = np.column_stack((np.full(len(t_s), 0.05), 6.0 + 0.5 * difference_n, 6.0 - 0.5 * difference_n))
    trace = made_trace(rows, phases=np.where(t_s <= held_s, int(HOLD), int(SQUEEZE)), t_s=t_s)
    return evolve(trace, signals=signals)


def shaken(trace):
    return create("feature-set", "shake").extract(trace)


@given(amplitude=st.floats(1e-3, 1e3), cycles=st.integers(12, 48), phase=st.floats(0.0, 6.3))
def test_a_sine_has_its_rms_in_its_band_and_nothing_elsewhere(amplitude, cycles, phase):
    """Over a second; of two axes the squares add."""
    t_s = np.arange(RATE_HZ) / RATE_HZ
    sine = amplitude * np.sin(2 * np.pi * cycles * t_s + phase)
    signal = Signal(np.stack([sine, sine], axis=1), RATE_HZ)
    assert rms(signal, 10.0, 50.0) == pytest.approx(amplitude)
    assert rms(signal, 50.0, 500.0) < 1e-6 * amplitude


@given(frequency=st.floats(3.0, 9.0), rate=st.floats(0.5, 3.0))
def test_a_wobble_that_fades_has_its_frequency_and_its_decay(frequency, rate):
    t_s = np.arange(2 * RATE_HZ) / RATE_HZ
    signal = Signal((np.exp(-rate * t_s) * np.sin(2 * np.pi * frequency * t_s))[:, np.newaxis], RATE_HZ)
    assert peak_hz(signal) == pytest.approx(frequency, abs=0.2)
    assert decay_1_s(signal) == pytest.approx(rate, rel=0.25, abs=0.1)


def test_a_shaken_thing_gives_its_mass_and_what_follows():
    features = shaken(grasp())
    # Three whole periods; Hann's window spreads them over three lines of the spectrum, all of them in the band.
    assert features["acceleration_low"] == pytest.approx(2.0 / math.sqrt(2.0), rel=0.02)
    assert features["moved_mass"] == pytest.approx(CARRIED_KG, rel=0.02)
    assert features["pads_peak"] == pytest.approx(5.0, abs=0.2)
    assert features["acceleration_decay"] == pytest.approx(2.0, rel=0.15)
    assert features["acceleration_high"] < 0.01
    assert not features.reasons


@every_case(
    ("trace", "missing", "there", "said"),
    [
        (grasp(shake=False), ["pads_low", "moved_mass"], [], "shake"),
        (grasp(held_s=0.9), ["pads_low", "moved_mass"], [], "hold"),
        (grasp(acceleration=False), ["acceleration_low", "acceleration_peak"], ["pads_low"], "acceleration"),
        (grasp(held_s=2.1), ["pads_peak", "pads_low_after"], ["pads_low", "moved_mass"], "after the shake"),
        (grasp(shake_hz=30.0), ["moved_mass"], ["acceleration_mid", "pads_mid", "pads_decay"], "faster"),
        (
            grasp(until_s=1.25),
            ["pads_low", "acceleration_low"],
            ["pads_mid", "pads_peak"],
            "too short",
        ),
        (
            grasp(hole_s=(1.2, 1.5)),
            ["acceleration_low", "acceleration_high"],
            ["pads_low", "acceleration_decay"],
            "no samples",
        ),
        (grasp(hole_s=(2.1, 2.6)), ["acceleration_decay", "acceleration_peak"], ["moved_mass"], "no samples"),
        (grasp(pad_hz=24), ["pads_mid", "pads_high"], ["pads_low", "acceleration_high"], "samples a second"),
    ],
)
def test_what_was_not_measured_is_missing_with_the_reason(trace, missing, there, said):
    features = shaken(trace)
    assert all(math.isnan(features[name]) and said in features.reasons[name] for name in missing)
    assert all(math.isfinite(features[name]) for name in there)


@pytest.fixture(scope="module")
def felt():
    """The features of three closed bottles, without spread, by how full they are. Simulated."""
    pipeline = load_pipeline("shake", options=["gripper.spread=false"])
    return {
        name: pipeline.grasp(object=f"flask_{name}:closed", seed=1).features
        for name in ("full", "half", "empty")
    }


@pytest.mark.slow
def test_water_with_a_surface_goes_on_after_the_shake_and_a_full_bottle_does_not(felt):
    # w^2 = 1.841 g / R with R = 29 mm, which is a deep cylinder.
    sloshing_hz = math.sqrt(1.841 * 9.81 / 0.029) / (2 * math.pi)
    assert felt["half"]["pads_peak"] == pytest.approx(sloshing_hz, rel=0.05)
    after = {name: features["pads_low_after"] for name, features in felt.items()}
    assert after["half"] > 5.0 * max(after["full"], after["empty"])


@pytest.mark.slow
def test_pads_feel_how_heavy_a_bottle_is(felt):
    """All of it but the wall that is pressed against the pad: 0.15 kg, and 0.45 kg of water."""
    assert felt["empty"]["moved_mass"] == pytest.approx(0.15, rel=0.1)
    assert felt["full"]["moved_mass"] == pytest.approx(0.60, rel=0.1)
    assert felt["empty"]["moved_mass"] < felt["half"]["moved_mass"] < felt["full"]["moved_mass"]


@pytest.mark.slow
def test_a_model_of_shaken_bottles_tells_another_one(tmp_path):
    """By its probabilities: after four grasps, another bottle may still count as unknown."""
    command = "train simulated --pipeline shake --objects flask_half:closed,flask_empty:closed --instances 2 --trials 1"
    printed(*command.split(), "--classifier", "extra-trees", "--out", tmp_path / "model.json")
    options = ["classifier.type=extra-trees", f"classifier.model={tmp_path / 'model.json'}"]
    pipeline = load_pipeline("shake", options=options)
    for label in ("flask_half:closed", "flask_empty:closed"):
        told = pipeline.grasp(object=f"{label}#77", seed=77).prediction.probabilities
        assert max(told, key=told.get) == label
