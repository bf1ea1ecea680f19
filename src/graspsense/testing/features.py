"""Conformance checks of a feature set."""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterator, Sequence
from copy import deepcopy
from math import inf, nan
from typing import Any, Final

import numpy as np
from attrs import evolve

from graspsense.core.components.compiled_features import columns_of_ticks, compiled_extraction
from graspsense.core.components.roles import FeatureSet
from graspsense.core.values.features import Features
from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import TICK_COLUMNS, Trace
from graspsense.core.values.units import is_si
from graspsense.testing.checks import demand, leaving_no_thread, raises_nothing
from graspsense.testing.samples import (
    COLUMNS_OF_CHANNEL,
    an_event,
    by_another_clock,
    contents_of,
    squeeze,
    unusual_traces,
    with_channels,
    with_signals,
)
from graspsense.testing.subject import Subject, elsewhere

CUTS: Final = 48
LONGEST_S: Final = 2.0
FAR_BEYOND: Final = {"m": 200.0, "N": 50.0, "s": 3.0, "J": 10.0, "m/s": 50.0}
"""Factors that a sum (over frequencies, of times) does not reach, and a unit with the prefix milli exceeds."""
STIFFNESSES_N_M: Final = (4000.0, 500.0)
"""The stiffness of the objects of two grasps; that of a whole grasp comes first."""
OTHER_PREFIX: Final = 30.0
"""Factor by which a stiffness can be computed in another way, and that a prefix exceeds."""
FEWER: Final = (1, 2, 4)
"""In grasps with fewer ticks, these are each k-th one."""


def _features(
    subject: Subject, trace: Trace, which: str = "a whole grasp", set_: FeatureSet[Any] | None = None
) -> Features:
    advice = f" on {which}: return NaN with a reason in `reasons` where a feature is not defined"
    with raises_nothing("extract", advice):
        features: Features = (set_ or subject.create()).extract(trace)
    demand(
        isinstance(features, Features),
        f"extract returned {features!r}: return graspsense.plugin_api.Features",
    )
    return features


def _whole(subject: Subject, stiffness_n_m: float = STIFFNESSES_N_M[0]) -> Trace:
    """Return a whole grasp of a gripper that has the further channels in `requires`, with an event."""
    event = evolve(an_event(), source="controller")
    return with_signals(evolve(squeeze(stiffness_n_m), events=(event,)), subject.entry.requires)


def _all(subject: Subject) -> dict[str, Trace]:
    """Return a whole grasp and unusual traces of a gripper with the further channels in `requires`, by descriptions."""
    unusual = {
        which: with_signals(trace, subject.entry.requires) for which, trace in unusual_traces().items()
    }
    return {"a whole grasp": _whole(subject), **unusual}


def _same(a: Features, b: Features) -> bool:
    same = (a.names, a.units, a.reasons) == (b.names, b.units, b.reasons)
    return same and repr(a.as_dict()) == repr(b.as_dict())


def extracts_in_time(subject: Subject) -> None:
    """A further `extract` of a whole grasp takes two seconds at most, and leaves no thread running."""
    set_, trace, took_s = subject.create(), _whole(subject), []
    _features(subject, trace, set_=set_)
    # Other work on the computer can hold it up, but hardly twice.
    for _ in range(2):
        began = time.perf_counter()
        with leaving_no_thread("it extracts"):
            _features(subject, trace, set_=set_)
        took_s.append(time.perf_counter() - began)
    demand(
        min(took_s) <= LONGEST_S,
        f"extract takes {min(took_s):.1f} s for a grasp of {trace.t_s[-1]:.1f} s, and an evaluation has thousands: "
        "compute with whole columns in place of loops, or give a form of it in `compiled`",
    )


def returns_the_declared_features(subject: Subject) -> None:
    """Any trace (empty, short, without a channel, with gaps) gives floats of the declared names and units, in order."""
    declared = tuple((feature.name, feature.unit) for feature in subject.entry.features)
    for which, trace in _all(subject).items():
        features = _features(subject, trace, which)
        given = tuple(zip(features.names, features.units, strict=True))
        demand(
            given == declared,
            f"on {which} it gives {_listed(given)}; `features` declares {_listed(declared)}: make `features` "
            "and what extract returns the same",
        )
        for name, _, value in _values(features):
            demand(
                type(value) is float,
                f"feature {name!r} is {value!r} of type {type(value).__name__} on {which}: write float(...)",
            )
        for name, reason in features.reasons.items():
            demand(type(reason) is str, f"the reason of {name!r} is {reason!r} on {which}: write it as text")


def units_are_of_the_si(subject: Subject) -> None:
    """Declared units are of the SI, without a prefix."""
    for feature in subject.entry.features:
        demand(
            is_si(feature.unit),
            f"feature {feature.name!r} has the unit {feature.unit!r}, which is none of the SI without a prefix: write "
            "it as in N, m/s2 or N s/m, counts for a sensor without a unit, and 1 for a ratio",
        )


def _listed(features: tuple[tuple[str, str], ...]) -> str:
    return ", ".join(f"{name} in {unit}" for name, unit in features) or "nothing"


def a_whole_grasp_has_features(subject: Subject) -> None:
    """For a whole grasp of an elastic object, at least one feature is defined."""
    features = _features(subject, _whole(subject))
    demand(
        any(value == value for value in features.values),
        f"every feature is missing on a whole grasp: {dict(features.reasons)}. A grasp approaches at 10 mm/s, touches "
        "at 60 mm, is squeezed by 4 mm to 16 N, held and released; each further channel goes from 0 to 16, in any unit",
    )


def values_fit_their_units(subject: Subject) -> None:
    """No feature has another prefix than its unit, as a comparison of grasps tells; without measurements, no value."""
    trace = _whole(subject)
    most = _most(trace)
    features = _features(subject, trace)
    for name, unit, value in _values(features):
        limit = FAR_BEYOND.get(unit, 1.0) * most.get(unit, inf)
        demand(
            not abs(value) > limit,
            f"feature {name!r} is {value:g} {unit} in a grasp with gaps to {most['m']:.2g} m and forces to "
            f"{most['N']:.2g} N, of {most['s']:.2g} s: convert it to its unit, or declare the unit that it has",
        )
    _demand_prefixes(subject, trace, features)
    unmeasured = {which: evolve(each, command=each.command * nan) for which, each in _all(subject).items()}
    for which, known in (("an empty trace", ()), ("a trace without any channel", ("s",))):
        for name, unit, value in _values(_features(subject, unmeasured[which], which)):
            demand(
                value != value or unit in ("1", "counts", *known),
                f"feature {name!r} is {value:g} {unit} on {which}: return NaN with a reason where nothing was "
                "measured; 0 would be taken for a measured value",
            )


def _most(trace: Trace) -> dict[str, float]:
    """Return the most that a grasp has of each unit."""
    gap_m, force_n = float(trace.gap_m.max()), float(trace.force_left_n.max())
    speed_m_s = float(np.abs(trace.velocity_m_s).max())
    return {"m": gap_m, "N": force_n, "s": float(trace.t_s[-1]), "J": force_n * gap_m, "m/s": speed_m_s}


def _demand_prefixes(subject: Subject, trace: Trace, features: Features) -> None:
    """Raise CheckFailed for a gap that is not in m, and for a stiffness or a compliance with a prefix."""
    wider = _features(subject, evolve(trace, gap_m=trace.gap_m + 1e-3))
    softer = _features(subject, _whole(subject, STIFFNESSES_N_M[1]))
    ratio = STIFFNESSES_N_M[0] / STIFFNESSES_N_M[1]
    for (name, unit, value), gap, soft in zip(_values(features), wider.values, softer.values, strict=True):
        power = {"N/m": 1, "m/N": -1}.get(unit, 0)
        follows = power and abs(value - ratio**power * soft) <= 0.2 * abs(value)
        factor = abs(value) / STIFFNESSES_N_M[0] ** power if follows else 1.0
        demand(
            1.0 / OTHER_PREFIX <= factor <= OTHER_PREFIX,
            f"feature {name!r} is {value:g} {unit} for an object of {STIFFNESSES_N_M[0]:g} N/m, and follows its "
            "stiffness: convert it to its unit, or declare the unit that it has",
        )
        moved = abs(gap - value) / 1e-3 if unit == "m" else 0.0
        demand(
            not any(abs(moved - prefix) <= 1e-3 * prefix for prefix in (10.0, 100.0, 1000.0)),
            f"feature {name!r} changes by {gap - value:g} m where the gaps are 0.001 m wider: give it in metres",
        )


def _values(features: Features) -> Iterator[tuple[str, str, float]]:
    return zip(features.names, features.units, features.values, strict=True)


def width_is_a_gap_of_the_grasp(subject: Subject) -> None:
    """The feature that is the width of the object lies within the gaps of the grasp."""
    trace, name = _whole(subject), subject.entry.width
    width = nan if name is None else _features(subject, trace)[name]
    low, high = float(trace.gap_m.min()), float(trace.gap_m.max())
    demand(
        width != width or low <= width <= high,
        f"{name!r} is the width of the object, and {width:g} in a grasp with gaps from {low:g} to {high:g} m: give it "
        "in metres, or leave `width=True` out",
    )


def handles_a_trace_that_ends_anywhere(subject: Subject) -> None:
    """`extract(trace.until(t))` works for every t, as early recognition needs it."""
    whole = _whole(subject)
    for k in range(CUTS):
        t = float(whole.t_s[-1]) * k / (CUTS - 1)
        _features(subject, whole.until(t), f"trace.until({t:.3f})")


def same_trace_same_features(subject: Subject) -> None:
    """The same trace gives the same features with the same and with another instance."""
    set_, trace = subject.create(), _whole(subject)
    features = _features(subject, trace, set_=set_)
    _features(subject, _whole(subject, STIFFNESSES_N_M[1]), set_=set_)
    for again in (_features(subject, trace, set_=set_), _features(subject, trace)):
        demand(
            _same(features, again),
            f"called again it gives {again.as_dict()}, not {features.as_dict()}: keep no state between calls and draw "
            "nothing at random",
        )


def same_features_elsewhere(subject: Subject) -> None:
    """Another interpreter gives the same features, at another time, with sets in another order, before other grasps."""
    _features(subject, _whole(subject))
    here, there = _in_words(subject), elsewhere(subject, _in_words)
    demand(
        here == there,
        f"in another interpreter, with another time zone and order of sets, it gives {there}, not {here}: read no "
        "clock, sort what comes out of a set, and keep nothing of the grasps before",
    )


def _in_words(subject: Subject) -> str:
    """Return the features of the beginning of a grasp, and then of the whole."""
    whole = _whole(subject)
    return repr([_features(subject, trace).as_dict() for trace in (whole.until(1.3), whole)])


def does_not_change_the_trace(subject: Subject) -> None:
    """`extract` does not change the trace."""
    trace = deepcopy(_whole(subject))
    contents = contents_of(trace)
    _features(subject, trace)
    changed = [name for name, content in contents_of(trace).items() if content != contents[name]]
    demand(
        not changed,
        f"extract changed {', '.join(changed)} of the trace: work on a copy "
        f"(`trace.{(changed or ['gap_m'])[0]}.copy()`)",
    )


def requires_what_it_reads(subject: Subject) -> None:
    """The channels in `requires` suffice: without the others, the features are the same, whichever pad bears more."""
    required = {require.name for require in subject.entry.requires}
    others = [name for name in COLUMNS_OF_CHANNEL if name not in required]
    whole = _whole(subject)
    turned = evolve(whole, force_left_n=whole.force_right_n, force_right_n=whole.force_left_n)
    for trace in (whole, turned):
        full, own = _features(subject, trace), _features(subject, with_channels(trace, required), "a grasp")
        demand(
            _same(full, own),
            f"without the channels it does not declare ({', '.join(others)}) it gives {own.as_dict()} instead of "
            f"{full.as_dict()}: add the channels that it reads to `requires`",
        )


def times_are_those_of_the_clock(subject: Subject) -> None:
    """No feature, whatever its unit, follows the number of ticks of the same time."""
    whole = _whole(subject)
    grasps = [_features(subject, _of_each(k, whole, subject), "a grasp with fewer ticks") for k in FEWER]
    slower = _features(subject, by_another_clock(whole, slower=2.0), "a grasp that takes twice as long")
    for i, (name, unit, value) in enumerate(_values(grasps[0])):
        values = [features.values[i] for features in grasps]
        # What knows no time, and changes by a tenth each time that half of the ticks are missing, counts them.
        steps = np.diff(values) if slower.values[i] == value else np.zeros(2)
        least = 0.1 * max(abs(value), abs(values[1]), 0.5 * _most(whole).get(unit, inf))
        timeless = np.abs(steps).min() > least and steps[0] * steps[1] > 0.0
        demand(
            not (timeless or any(_follows(values, power) for power in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0))),
            f"feature {name!r} is {value:g} {unit}, and {values[1]:g} {unit} where half of the ticks are missing: take "
            "times from `trace.t_s`, means in place of sums, and differences over a time, since grippers have "
            "different rates",
        )


def _follows(values: Sequence[float], power: float) -> bool:
    """Return whether the values of grasps with fewer ticks are as this power of the number of the ticks."""
    return all(
        abs(few - values[0] * k**power) <= 0.03 * abs(few) and abs(few) > 1e-9
        for k, few in zip(FEWER, values, strict=True)
    )


def _of_each(k: int, trace: Trace, subject: Subject) -> Trace:
    """Return the trace with each k-th of its ticks."""
    fewer = evolve(trace, **{name: getattr(trace, name)[::k] for name in TICK_COLUMNS}, signals={})
    return with_signals(fewer, subject.entry.requires)


def independent_of_the_start_of_the_clock(subject: Subject) -> None:
    """A shift of all times changes no feature beyond rounding."""
    whole = _whole(subject)
    exact = evolve(whole, t_s=np.round(whole.t_s * 2.0**30) / 2.0**30)  # whose differences are not rounded
    early, late = (_features(subject, trace) for trace in (exact, by_another_clock(exact, seconds=64.0)))
    for name, a, b in zip(early.names, early.values, late.values, strict=True):
        demand(
            (a != a and b != b) or abs(a - b) <= max(1e-6, 1e-3 * abs(a)),
            f"feature {name!r} is {a:g}, and {b:g} for the same grasp with a clock that began 64 s earlier: use "
            "differences of times",
        )


def compiled_features_are_those_of_extract(subject: Subject) -> None:
    """A compiled form gives what `extract` does for every trace, and reads no release unless it says so."""
    set_ = subject.create()
    form = compiled_extraction(set_.extract)
    if form is None:
        return
    demand(
        inspect.isfunction(form.measure) and form.measure.__closure__ is None,
        f"{form.measure!r} in `compiled` is not a module function: write one, which numba can compile",
    )
    for which, trace in _all(subject).items():
        extracted = set_.extract(trace)
        advice = f" on {which}: return the same tuple of floats for every grasp"
        with raises_nothing("`compiled`", advice):
            measured = form.measure(form.params, columns_of_ticks(trace))
            numbers = map(float, measured)
            named_tuple = getattr(measured, "_make", tuple)
            features: Features = form.result(named_tuple(numbers))
        demand(
            _same(features, extracted),
            f"on {which} `compiled` gives {_with_reasons(features)}, and `extract` gives {_with_reasons(extracted)}: "
            "make `compiled` measure what `extract` does",
        )
        released = np.flatnonzero(trace.phase == Phase.RELEASE)
        if form.reads_release or not len(released) or not (trace.phase == Phase.HOLD).any():
            continue
        held = set_.extract(trace.until(float(trace.t_s[released[0]])))
        demand(
            _same(extracted, held),
            f"on {which} it gives {_with_reasons(extracted)}, and without the release {_with_reasons(held)}: remove "
            "`reads_release=False` of `compiled`, or read no tick of the release",
        )


def _with_reasons(features: Features) -> str:
    return f"{features.as_dict()} with the reasons {dict(features.reasons)}"
