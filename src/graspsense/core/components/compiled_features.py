"""Features in a form that a simulator compiles, so that a batch extracts them without building traces.

A feature set may declare `FeatureSet.compiled`: a function that measures what the features need on the columns of a
grasp, and a function that makes features of these numbers. A simulator of batches calls the first as machine code where
it does not keep the traces, and `extract` everywhere else. A set without this declaration extracts from traces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MethodType
from typing import TYPE_CHECKING, Any, NamedTuple

from attrs import frozen

from graspsense.core.control.binding import bind
from graspsense.core.values.features import Features

if TYPE_CHECKING:
    from graspsense.core.values.trace import Trace

Numbers = Any
"""A tuple of floats, or a named tuple of floats."""


class TickColumns(NamedTuple):
    """The columns of a trace over its ticks, arrays (n,), under their names in `Trace`."""

    t_s: Any
    gap_m: Any
    velocity_m_s: Any
    effort_n: Any
    force_left_n: Any
    force_right_n: Any
    edge_left_n: Any
    edge_right_n: Any
    command: Any
    phase: Any


@frozen
class CompiledFeatures:
    """How a feature set extracts features without a trace; what it returns must agree with `extract`.

    The conformance checks compare both on whole and on unusual grasps.

    >>> from graspsense.plugin_api import Channel, Feature, FeatureSet
    >>> from graspsense.simulator_api import CompiledFeatures
    >>> from graspsense.testing_api import squeeze
    >>> def measure(params, ticks):
    ...     peak = -1.0
    ...     for force in ticks.force_left_n:
    ...         if force > peak:
    ...             peak = force
    ...     return (peak,)
    >>> def features_of(feature_set, measured, units):
    ...     (peak,) = measured
    ...     return feature_set.result({"peak": peak}) if peak >= 0.0 else feature_set.undefined("no force is known")
    >>> class Peak(FeatureSet[None]):
    ...     requires = (Channel("force_left", "N"),)
    ...     features = (Feature("peak", "N", "largest force of the left pad"),)
    ...     compiled = CompiledFeatures(measure, lambda feature_set: (), features_of)
    ...
    ...     def extract(self, trace):
    ...         return features_of(self, measure((), trace), trace.units)
    >>> round(Peak(None).extract(squeeze(stiffness_n_m=1000.0))["peak"], 3)
    4.0
    """

    measure: Callable[[Any, TickColumns], Numbers]
    """`measure(params, ticks)`: a module function in the subset of Python that numba compiles. It returns a tuple of
    floats, as many for every grasp, from which the features follow. It must not change the columns."""
    params: Callable[[Any], Numbers]
    """`params(feature_set)`: the parameters of `measure`, a named tuple of floats and integers."""
    features: Callable[[Any, Numbers, Mapping[str, str]], Features]
    """`features(feature_set, measured, units)`: the features of a grasp, given what `measure` returned and
    `Trace.units`."""
    reads_release: bool = True
    """False: the features of a grasp with a tick of the phase HOLD are the same without the ticks after the first one
    of its release. A batch then does not simulate those."""


@frozen
class CompiledExtraction:
    """A function of a trace in the form that a simulator compiles: `result(measure(params, ticks))`."""

    measure: Callable[[Any, TickColumns], Numbers]
    params: Numbers
    result: Callable[[Numbers], Any]
    reads_release: bool = True
    """As in `CompiledFeatures`."""


def compiled_extraction(extract: Callable[[Trace], Any] | None) -> CompiledExtraction | None:
    """Return the form to compile of a function of a trace; None if it has none.

    It has one if it is `feature_set.extract` of a set that declares `FeatureSet.compiled`, or an object with a method
    `compiled_extraction`, which returns it.
    """
    own = getattr(extract, "compiled_extraction", None)
    if own is not None:
        extraction: CompiledExtraction | None = own()
        return extraction
    if not isinstance(extract, MethodType):
        return None
    # The mark is on the function, so that none applies to a subclass or a test that replaces `extract`.
    form: CompiledFeatures | None = getattr(extract.__func__, "compiled", None)
    if form is None:
        return None
    # Imported here, since the declarations of a feature set are read without numpy.
    from graspsense.core.values.trace import SI_UNITS

    feature_set = extract.__self__

    def result(measured: Numbers) -> Features:
        return form.features(feature_set, measured, SI_UNITS)

    return CompiledExtraction(form.measure, form.params(feature_set), result, form.reads_release)


def columns_of_ticks(trace: Trace) -> TickColumns:
    """Return the columns of a trace."""
    return TickColumns(*(getattr(trace, name) for name in TickColumns._fields))


def listed_columns(trace: Trace) -> TickColumns:
    """Return the columns of a trace as lists, which the interpreter reads in a third of the time."""
    return TickColumns(*(column.tolist() for column in columns_of_ticks(trace)))


def both(left: CompiledExtraction, right: CompiledExtraction) -> CompiledExtraction:
    """Return the form of a function that returns a pair: the results of both."""

    def result(measured: Numbers) -> tuple[Any, Any]:
        left_measured, right_measured = measured
        return left.result(left_measured), right.result(right_measured)

    measure = bind(_measure_both, measure_one=left.measure, measure_other=right.measure)
    return CompiledExtraction(
        measure, (left.params, right.params), result, left.reads_release or right.reads_release
    )


def _nothing(params: Any, ticks: TickColumns) -> Numbers:
    return ()


measure_one: Callable[[Any, TickColumns], Numbers] = _nothing
measure_other: Callable[[Any, TickColumns], Numbers] = _nothing


def _measure_both(params: Any, ticks: TickColumns) -> Numbers:
    return measure_one(params[0], ticks), measure_other(params[1], ticks)
