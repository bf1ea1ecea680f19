"""Features, tables of features, and predictions: the values that pass between a feature set and a classifier."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

from attrs import evolve, field, frozen

from graspsense.core.values.display import html
from graspsense.core.values.errors import listed
from graspsense.core.values.json_values import json_ready
from graspsense.core.values.printable import in_one_line
from graspsense.core.values.reasons import Reason
from graspsense.core.values.units import quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SHOWN: Final = 200
"""Most features of a grasp that are printed or drawn."""
LARGEST_VALUE: Final = 1e100
"""The largest magnitude of a number to learn from: the squares of its differences, and their sums, are still finite."""


@frozen(kw_only=True)
class Features:
    """Named numbers extracted from one trace.

    A feature that is not defined for this trace is NaN, and `reasons` gives the reason. NaN means *missing*.
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    units: tuple[str, ...]
    reasons: Mapping[str, str] = field(factory=dict)

    def __attrs_post_init__(self) -> None:
        if not len(self.names) == len(self.values) == len(self.units):
            raise ValueError(
                f"{len(self.names)} names, {len(self.values)} values and {len(self.units)} units: "
                "give one of each a feature"
            )
        # A batch makes thousands of these: a finite sum has only finite values.
        if math.isfinite(sum(self.values)):
            return
        for name, value in zip(self.names, self.values, strict=True):
            if math.isinf(value):
                raise ValueError(
                    f"feature {name!r} is {value}: give NaN with a reason where it is not defined"
                )
            if math.isnan(value) and not self.reasons.get(name):
                raise ValueError(f"feature {name!r} is NaN without a reason: add one to `reasons`")

    def shown(self) -> tuple[list[tuple[str, float, str]], str]:
        """Return name, value and unit of the features that people are shown, and in words how many more there are."""
        rows = list(zip(self.names, self.values, self.units, strict=True))[:SHOWN]
        left = len(self.names) - len(rows)
        return rows, f"{left} more features" if left else ""

    def __repr__(self) -> str:
        rows, more = self.shown()
        each = [f"{name} {quantity(value, unit)}" for name, value, unit in rows]
        words = ", ".join([*each, more] if more else each)
        return in_one_line(f"<Features: {words or 'none'}>")

    def _repr_html_(self) -> str:
        return html(self)

    def __getitem__(self, name: str) -> float:
        """Return the value of one feature; KeyError names the known ones."""
        try:
            return self.values[self.names.index(name)]
        except ValueError:
            raise KeyError(f"no feature {name!r}; there are {listed(self.names)}") from None

    def as_dict(self) -> dict[str, float | None]:
        """Return name to value, with None for a missing one (JSON has no NaN)."""
        return {n: None if math.isnan(v) else v for n, v in zip(self.names, self.values, strict=True)}


@frozen(kw_only=True, eq=False)
class FeatureTable:
    """Features of many trials: `values` has shape (trials, features), NaN is missing.

    `reasons` says, by the number of a trial, why its features are missing, where that is known.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: NDArray[np.float64]
    reasons: Mapping[int, Mapping[str, str]] = field(factory=dict)

    def __len__(self) -> int:
        """Return the number of trials."""
        return len(self.values)

    def rows(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> FeatureTable:
        """Return the table of these trials, by number or by a mask."""
        numbers = (which.nonzero()[0] if which.dtype == bool else which).tolist() if self.reasons else ()
        reasons = {k: self.reasons[i] for k, i in enumerate(numbers) if i in self.reasons}
        return evolve(self, values=self.values[which], reasons=reasons)

    def columns(self, names: Sequence[str]) -> FeatureTable:
        """Return the table of these features, in this order. KeyError names the known ones."""
        places = {name: i for i, name in enumerate(self.names)}
        for name in names:
            if name not in places:
                raise KeyError(f"no feature {name!r}; there are {listed(self.names)}")
        which = [places[name] for name in names]
        units = tuple(self.units[i] for i in which)
        return evolve(self, names=tuple(names), units=units, values=self.values[:, which])

    def row(self, i: int, reason: str = "missing in the table") -> Features:
        """Return the features of one trial; each missing one of which no reason is known has this."""
        values, known = tuple(float(v) for v in self.values[i]), self.reasons.get(i, {})
        absent = {n: known.get(n, reason) for n, v in zip(self.names, values, strict=True) if math.isnan(v)}
        return Features(names=self.names, values=values, units=self.units, reasons=absent)


def misfit(taker: str, names: Sequence[str], units: Sequence[str], given: Features | FeatureTable) -> str:
    """Return why something that takes these features cannot take the given ones; empty if it can.

    `taker` says what takes them. A unit that is not stated on one side fits any.
    """
    lacking = [name for name in names if name not in given.names]
    if lacking:
        return f"{taker} takes the features {listed(names)}; there is no {listed(lacking)} among {listed(given.names)}"
    unit_of = dict(zip(given.names, given.units, strict=True))
    for name, unit in zip(names, units, strict=True):
        if unit and unit_of[name] and unit != unit_of[name]:
            return f"{taker} takes {name} in {unit}; here it is in {unit_of[name]}"
    return ""


def assumed_units(names: Sequence[str], units: Sequence[str], given: FeatureTable) -> tuple[str, ...]:
    """Return a note on the given features that state no unit where one is expected; empty if there are none."""
    unit_of = dict(zip(given.names, given.units, strict=True))
    assumed = [
        f"{name} in {unit}" for name, unit in zip(names, units, strict=True) if unit and not unit_of[name]
    ]
    return (
        (f"the table states no unit, and the model has one: taken as {listed(assumed)}",) if assumed else ()
    )


class FeatureRows:
    """Collects the features of trials for a table, and keeps their numbers and reasons only."""

    def __init__(self) -> None:
        self._first: Features | None = None
        self._values = array("d")
        self._reasons: dict[int, Mapping[str, str]] = {}
        self._n = 0

    def add(self, features: Features) -> None:
        """Add a trial. Raises ValueError if its features differ from those of the first one in names or units."""
        model = self._first = self._first or features
        if features.names != model.names or features.units != model.units:
            raise ValueError(
                f"trials disagree: {features.names} in {features.units} beside {model.names} in {model.units}"
            )
        self._values.extend(features.values)
        if features.reasons:
            self._reasons[self._n] = features.reasons
        self._n += 1

    def table(self) -> FeatureTable:
        """Return the table of the trials added so far. Raises ValueError if there are none."""
        import numpy as np

        if self._first is None:
            raise ValueError("a table needs at least one trial")
        values = np.array(self._values, dtype=np.float64).reshape(self._n, len(self._first.names))
        return FeatureTable(
            names=self._first.names, units=self._first.units, values=values, reasons=self._reasons
        )


def table_of(rows: Iterable[Features]) -> FeatureTable:
    """Return the table of these features, one row for each; a classifier explains one trial by a table of one row.

    Raises ValueError if they differ in names or units.

    >>> table_of([Features(names=("p_first",), values=(0.05,), units=("m",))]).values
    array([[0.05]])
    """
    collected = FeatureRows()
    for row in rows:
        collected.add(row)
    return collected.table()


def _reasons(items: Iterable[Reason | str]) -> tuple[Reason, ...]:
    return tuple(item if isinstance(item, Reason) else Reason(words=item) for item in items)


WIDE: Final = 0.1
"""Width of the interval of a certainty from which on it is printed."""


@frozen(kw_only=True)
class Prediction:
    """The prediction of a classifier for one trial.

    `label` is a class, or `unknown` for a trial far outside the training data. `probabilities` sum to 1; they are empty
    if the model could not be applied. `because` has the reasons (`Reason`) in words and units; a text that is given
    becomes a reason without values. `model` describes in one line what the model was trained on. `support` is None, or
    two numbers of training trials from which the probability of the label was computed: those with the label, and all
    of those in the leaf of the tree, or among the nearest. `prediction_set` has the labels that cannot be ruled out,
    the most probable first: it contains the true label of a new object with the probability `coverage`. It is empty,
    and `coverage` None, if the model is not calibrated or the trial is unknown. `calibrated` says whether the
    probabilities agree with rates in held-out trials (`graspsense.core.learn.certainty`); `no_certainty` says why not.
    `certainty_interval` is the 95 % interval of the certainty, None if it was not measured. `holds_for` says for
    which grasps both hold, such as those of `the same objects and sessions`: it is not known that others were held out.
    """

    label: str
    probabilities: Mapping[str, float]
    because: tuple[Reason, ...] = field(converter=_reasons)
    warnings: tuple[str, ...] = field(default=(), converter=tuple[str, ...])
    model: str = ""
    support: tuple[float, float] | None = None
    prediction_set: tuple[str, ...] = field(default=(), converter=tuple[str, ...])
    coverage: float | None = None
    calibrated: bool = False
    no_certainty: str = ""
    certainty_interval: tuple[float, float] | None = None
    holds_for: str = ""

    @property
    def set_in_words(self) -> str:
        """The set, such as `full_open or empty_open (right in 90 % of grasps)`; empty without a set."""
        return self.coverage_in_words(" or ".join(self.prediction_set))

    def coverage_in_words(self, labels: str) -> str:
        """The labels of a set, as said here, with the coverage; empty without a set.

        The coverage is that of sets of all sizes together: those of many labels hold more often, those of few less.
        """
        if self.coverage is None:
            return ""
        return f"{labels} (right in {certainty_words(self.coverage)} of grasps{self._for_which})"

    @property
    def _for_which(self) -> str:
        return f" for {self.holds_for}" if self.holds_for else ""

    @property
    def certainty(self) -> float | None:
        """The share of right answers among those that rest on as much; None if it was not measured."""
        return self.probabilities.get(self.label) if self.calibrated else None

    def without_certainty(self, why: str) -> Prediction:
        """Return it without certainty and set for this reason; one that has neither keeps its own reason."""
        return evolve(
            self,
            prediction_set=(),
            coverage=None,
            calibrated=False,
            certainty_interval=None,
            no_certainty=self.no_certainty or why,
        )

    @property
    def certainty_figure(self) -> str:
        """The certainty in per cent, with its interval if that is wide: `92 % (72 to 98 %)`; empty without one.

        It says so where it holds `for the same objects and sessions` only.
        """
        if self.certainty is None:
            return ""
        low, high = self.certainty_interval or (self.certainty, self.certainty)
        interval = f" ({100 * low:.0f} to {100 * high:.0f} %)" if high - low > WIDE else ""
        return certainty_words(self.certainty) + interval + self._for_which

    @property
    def certainty_in_words(self) -> str:
        """The certainty with what it rests on, such as `about 88 %: 6 of 6 training trials`; empty without either."""
        with_label, trials = self.support or (0.0, 0.0)
        rests = f"{with_label:.4g} of {trials:.4g} training trials" if self.support is not None else ""
        if self.certainty is not None:
            about = self.certainty_figure
            return (about if about.startswith("over") else f"about {about}") + (f": {rests}" if rests else "")
        why = f"no certainty: {self.no_certainty}" if self.no_certainty else ""
        return "; ".join(part for part in (rests, why) if part)

    @property
    def in_words(self) -> dict[str, Any]:
        """What a page or a message shows of it: label, certainty with its interval, set and reasons."""
        return {
            "label": self.label,
            "certainty": self.certainty_in_words,
            "set": self.set_in_words,
            "because": [reason.words for reason in self.because],
        }

    def as_json(self) -> dict[str, Any]:
        """Return label, probabilities, set and reasons as `--json` prints them."""
        names = (
            "label",
            "probabilities",
            "support",
            "prediction_set",
            "coverage",
            "certainty",
            "certainty_interval",
        )
        values = {name: getattr(self, name) for name in (*names, "calibrated", "holds_for", "no_certainty")}
        shown: dict[str, Any] = json_ready(
            {**values, "because": [reason.as_json() for reason in self.because]}
        )
        return shown

    def __repr__(self) -> str:
        certainty = f", {self.certainty_in_words}" if self.certainty_in_words else ""
        return in_one_line(f"<Prediction: {self.label}{certainty}>")

    def _repr_html_(self) -> str:
        return html(self)


UNKNOWN = "unknown"


@frozen(kw_only=True, eq=False)
class CheckpointPrediction:
    """A prediction while the grasp went on: so many seconds after the contact, known to the loop at the time `t_s`."""

    after_s: float
    t_s: float
    features: Features
    prediction: Prediction

    @property
    def sure(self) -> bool:
        """Whether the prediction set has one label."""
        return self.prediction.label != UNKNOWN and len(self.prediction.prediction_set) == 1

    @property
    def words(self) -> str:
        """The checkpoint with the prediction: `0.2 s after the contact: soft or hard (right in 90 % of grasps)`.

        A set with one label has the certainty of the answer in place of that of the sets. Of a set with more than three
        labels, only the first is named, so that it stays one line in a terminal.
        """
        made = self.prediction
        likeliest, *others = made.prediction_set or (made.label,)
        if self.sure and made.certainty is not None:
            said = f"{likeliest}, {made.certainty_figure}"
        elif len(others) > 2:
            said = made.coverage_in_words(f"{likeliest} or one of {len(others)} others")
        else:
            said = made.set_in_words
        return f"{self.after_s:g} s after the contact: {said or made.label}"


def certainty_words(probability: float) -> str:
    """Return a probability in per cent. No model is certain, so that 1 is `over 99 %`."""
    return "over 99 %" if probability > 0.995 else f"{100 * probability:.0f} %"


@lru_cache(maxsize=64)
def units_in(t: str, gap: str, force: str, declared: tuple[str, ...]) -> tuple[str, ...]:
    """Return declared units as those of a trace with these units: a recording can count time in frames.

    >>> units_in("frame", "m", "N", ("s", "m/s", "J", "1"))
    ('frame', 'm/frame', 'J', '1')
    """
    joule = "J" if (gap, force) == ("m", "N") else f"{force} {gap}"
    unit_of = {"m": gap, "N": force, "s": t, "J": joule, "N/m": f"{force}/{gap}"}
    unit_of |= {
        f"{unit}/{time}": f"{unit_of[unit]}/{t}{time[1:]}" for unit in ("m", "N") for time in ("s", "s2")
    }
    return tuple(unit_of.get(unit, unit) for unit in declared)


def missing(names: Iterable[str], reason: str) -> dict[str, str]:
    """Return one reason for each of these features.

    >>> missing(("f_steady", "df_dt"), "no pad felt 0.5 N")
    {'f_steady': 'no pad felt 0.5 N', 'df_dt': 'no pad felt 0.5 N'}
    """
    return dict.fromkeys(names, reason)
