"""Trials with labels: the data that a classifier is trained and evaluated on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

from attrs import evolve, field, frozen
from attrs.converters import optional

from graspsense.core.components.caller import option
from graspsense.core.learn.target_value import TargetValue
from graspsense.core.values.errors import ConfigError, DataDamaged, counted, suggestion
from graspsense.core.values.features import LARGEST_VALUE, FeatureTable
from graspsense.core.values.label_text import label_text, natural_order
from graspsense.core.values.limits import CLASSES, FEATURES
from graspsense.core.values.printable import in_one_line

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

Target = Literal["both", "class", "state"]
TARGETS: Final[tuple[Target, ...]] = ("both", "class", "state")
"""The part of a label `class:state` to predict: all of it, the class, or the state."""
_OF_EACH_TRIAL: Final = (
    "labels",
    "instances",
    "order",
    "content",
    "before_contact",
    "first_line",
    "width",
    "value",
    "recorded_with",
    "variants",
)
"""The fields of `Labelled` that have a value for each trial, besides its table."""


@frozen(kw_only=True, eq=False)
class ControlFeatures:
    """Other features of the same trials, evaluated as a baseline; `what` describes them in words."""

    table: FeatureTable
    what: str

    @property
    def having(self) -> NDArray[np.bool_]:
        """Which trials have any of the features."""
        import numpy as np

        return np.asarray(~np.isnan(self.table.values).all(axis=1))

    @property
    def having_words(self) -> str:
        """How many trials have any of the features, in words, with the most frequent reason why others have none."""
        having = self.having
        reasons = Counter(reason for row in self.table.reasons.values() for reason in {*row.values()})
        why = f": {reasons.most_common(1)[0][0]}" if reasons else ""
        return f"{int(having.sum())} of {counted(len(having), 'trial')} have such features{why}"


def _label_texts(labels: Sequence[str]) -> tuple[str, ...]:
    """Return the labels; those that look the same get the same text, and others stay as they are."""
    forms: dict[str, set[str]] = {}
    for label in set(labels):
        forms.setdefault(label_text(label), set()).add(label)
    same = {label: text for text, written in forms.items() if len(written) > 1 for label in written}
    return tuple(same.get(label, label) for label in labels)


@frozen(kw_only=True, eq=False)
class Labelled:
    """Trials with their features and labels.

    `labels` are `class:state`, or a class alone. `instances` identify the individual object of each trial
    (`odwalla#3`); None if that was not recorded, with the reason in `no_instances`. If `grouped`, they are trials that
    belong together (`learn.groups`), of objects that are not known. `order` numbers the trials in the order of
    recording. `before_contact` are features from before contact only, None with the reason in
    `no_before_contact`; `first_line` are the numbers of the first frame alone, if the trials were imported; `width` is
    the width alone. `variants` are further tables to evaluate. If rates on these
    trials say nothing about other objects, `no_interval` is the reason, and they get no interval. `notes` tell what a
    reader of a rate must know, `provenance` how the trials were made.

    Raises ValueError if the columns differ in length, and ConfigError for more labels or features than the limits
    `CLASSES` and `FEATURES` accept.
    """

    source: str
    table: FeatureTable
    labels: tuple[str, ...] = field(converter=_label_texts)
    instances: tuple[str, ...] | None = field(default=None, converter=optional(_label_texts))
    no_instances: str = ""
    grouped: bool = False
    sessions: bool = False
    """Whether the instances are sessions, in each of which several objects may have been grasped."""
    recorded_with: Mapping[str, tuple[str, ...]] = field(factory=dict)
    """What is known of how each trial was recorded and is no feature, by its name: settings, a session, an operator."""
    no_interval: str = ""
    no_certainty: str = ""
    """Why these trials do not tell how often answers are right; empty if nothing was found."""
    order: tuple[int, ...] | None = None
    no_order: str = ""
    content: tuple[str, ...] | None = None
    """Equal for trials that are the same recording, or a part of it; empty where the recording is not known."""
    before_contact: ControlFeatures | None = None
    no_before_contact: str = ""
    first_line: ControlFeatures | None = None
    width: ControlFeatures | None = None
    no_width: str = ""
    variants: Mapping[str, ControlFeatures] = field(factory=dict)
    value: TargetValue | None = None
    """A number to predict in place of the label; a trial without a label has an empty one."""
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(factory=dict)

    def __attrs_post_init__(self) -> None:
        for name in ("labels", "instances", "order", "content"):
            column = getattr(self, name)
            if column is not None and len(column) != len(self.table):
                raise ValueError(
                    f"{len(self.table)} trials and {len(column)} {name}: give one for each trial"
                )
        controls = [control.table for _, control, _, _ in self.other_features() if control is not None]
        for table in (self.table, *controls):
            _refuse_too_large(table.names, table.values, self.source)
        if self.value is not None:
            _refuse_too_large([self.value.name], [[value] for value in self.value.values], self.source)
        labels = len(set(self.labels)) if self.value is None else 1
        too_many = CLASSES.exceeded(labels) or FEATURES.exceeded(len(self.table.names))
        if too_many:
            raise ConfigError(f"{self.source} has {too_many}")

    def __len__(self) -> int:
        """Return the number of trials."""
        return len(self.labels)

    def __repr__(self) -> str:
        labels, features = counted(len(self.classes), "label"), counted(len(self.table.names), "feature")
        words = f"{counted(len(self), 'trial')} of {labels} with {features}, from {self.source}"
        return in_one_line(f"<Labelled: {words}>")

    @property
    def classes(self) -> tuple[str, ...]:
        """The labels that occur, sorted."""
        return tuple(sorted(set(self.labels)))

    def refuse_one_label(self) -> None:
        """Raise ConfigError, with the notes, unless there are at least two labels."""
        if len(self.classes) < 2:
            why = f"every trial of {self.source} has the label {self.labels[0]!r}: there is nothing to tell apart"
            raise ConfigError("\n  ".join((why, *self.notes)))

    def other_features(self) -> Iterator[tuple[str, ControlFeatures | None, str, str]]:
        """Yield the tables that controls learn from: name, features if any, what they are, why there are none."""
        yield (
            "before_contact",
            self.before_contact,
            "features from before contact only",
            self.no_before_contact,
        )
        if self.first_line is not None:
            yield "first_line", self.first_line, "", ""
        yield "width_only", self.width, "the width alone", self.no_width
        for name, variant in self.variants.items():
            yield name, variant, "", ""

    def rows(self, which: NDArray[np.int64]) -> Labelled:
        """Return these trials, in this order."""
        numbers = which.tolist()

        def picked(column: Any) -> Any:
            """Return the rows of what has one for each trial; None stays."""
            if isinstance(column, Mapping):
                return {name: picked(each) for name, each in column.items()}
            if isinstance(column, ControlFeatures):
                return evolve(column, table=column.table.rows(which))
            if isinstance(column, TargetValue):
                return evolve(column, values=picked(column.values))
            return column and tuple(column[i] for i in numbers)

        changed = {name: picked(getattr(self, name)) for name in _OF_EACH_TRIAL}
        return evolve(self, table=self.table.rows(which), **changed)

    def of_class(self, name: str) -> Labelled:
        """Return the trials of one class. Raises ConfigError if there are none."""
        import numpy as np

        return self.rows(np.array(rows_of_class(self.labels, name, self.source)))

    def aimed(self, target: str) -> Labelled:
        """Return the trials with one of `TARGETS` as labels.

        Raises ConfigError if the labels have no state, DataDamaged for another target, which only a model can have.
        """
        if target not in TARGETS:
            raise DataDamaged(
                f"a model predicts one of {', '.join(TARGETS)}; the target of this one is {target!r}"
            )
        if target == "both":
            return self
        if target == "class":
            return evolve(self, labels=tuple(class_of(label) for label in self.labels))
        for label in self.labels:
            if ":" not in label:
                raise ConfigError(
                    f"label {label!r} in {self.source} has no state: labels are CLASS:STATE, as in can:full_open. "
                    f"Choose {option('target', 'both')}, which takes labels as they are"
                )
        return evolve(self, labels=tuple(label.partition(":")[2] for label in self.labels))


def _refuse_too_large(names: Sequence[str], rows: ArrayLike, source: str) -> None:
    """Raise DataDamaged for a number that nothing can be learned from, since its square is not finite."""
    import numpy as np

    values = np.asarray(rows)
    for trial, column in np.argwhere(np.abs(values) > LARGEST_VALUE)[:1].tolist():
        raise DataDamaged(
            f"{source}: {names[column]!r} of trial {trial + 1} is {values[trial, column]:g}: the largest magnitude to "
            f"learn from, or to predict, is {LARGEST_VALUE:g}. Correct it, or leave a feature out "
            f"({option('features', '-NAME', python='columns')})"
        )


def recognised(target: Target, labels: Sequence[str]) -> Target:
    """Return what a correct prediction of these labels recognises: the class, if they have no state."""
    return "class" if target == "both" and not any(":" in label for label in labels) else target


def rows_of_class(labels: Sequence[str], name: str, source: str) -> list[int]:
    """Return the numbers of the trials of one class of this source. Raises ConfigError if there are none."""
    rows = [row for row, label in enumerate(labels) if class_of(label) == name]
    if not rows:
        known = natural_order(map(class_of, labels))
        told = f"no trial of class {name!r} in {source}. Known: {', '.join(known)}."
        raise ConfigError(told + suggestion(name, known))
    return rows


def class_of(label: str) -> str:
    """Return the class of a label `class:state`."""
    return label.partition(":")[0]
