"""Collecting labelled trials with an operator: which object comes next, what the operator answers, and what is left.

The state of a collection is in its store alone, so it continues after a kill. Objects come in rounds, each in its own
order drawn from the seed: if all trials of one class were recorded in a row, the classes would also differ by the
time of recording.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeVar

from attrs import define, field, frozen

from graspsense.core.components.caller import option
from graspsense.core.components.registry import Plugins
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.grasp.sinks import Sink
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError, NoDevice
from graspsense.core.values.signals import Outcome
from graspsense.core.values.trial import Trial
from graspsense.store.changes import set_aside
from graspsense.store.comparable import check_device, check_settings, newest_grasp
from graspsense.store.labels import check_label, labels_of
from graspsense.store.record_grasp import RecordedTrial, record_grasp
from graspsense.store.rows import StoredTrial
from graspsense.store.store import Store

T = TypeVar("T")
HELP: Final = (
    "keys: Enter grasps it, u undoes the last trial, r repeats the last trial, s skips this object, q stops, ? shows "
    "this; Ctrl-C stops a grasp and the collection"
)
UNDONE: Final = "undone by the operator"
RETAKEN: Final = "repeated by the operator"


@frozen(kw_only=True)
class Wanted:
    """What to collect: labels in the form that `labels_of` accepts, and the number of trials of each."""

    words: tuple[str, ...]
    each: int
    seed: int = 0
    labels: Mapping[str, str] = field(factory=dict)
    """Further labels of every trial, such as the name of the operator."""

    def __attrs_post_init__(self) -> None:
        if not self.words:
            raise ConfigError(
                f"nothing to collect: name the objects, as in {option('labels', 'can:full_open,can:empty_open')}"
            )
        if len(set(self.words)) < len(self.words):
            raise ConfigError(f"a label is named twice: {', '.join(self.words)}")
        if self.each < 1:
            raise ConfigError(f"{self.each} trials of each: give at least 1")
        for word in self.words:
            labels_of(word)


@define(eq=False)
class Collection:
    """A collection of trials into a store.

    `settings_for(label, seed)` returns the settings of a grasp. `ask` asks the operator a question and returns the
    answer, or None at the end of input. `say` prints a message, `show` what was felt in a trial of this label.
    `changed` allows a gripper or settings that differ from those of earlier trials.
    """

    store: Store
    wanted: Wanted
    plugins: Plugins
    settings_for: Callable[[str, int], Settings]
    ask: Callable[[str], str | None]
    say: Callable[[str], None]
    show: Callable[[str, Trial], None] = lambda word, trial: None
    changed: bool = False
    sinks: Sequence[Sink] = ()
    collected: dict[int, str] = field(factory=dict, init=False)
    """The label of each trial that this collection has stored, by its number."""
    _skipped: set[str] = field(factory=set, init=False)

    def counts(self) -> dict[str, int]:
        """Return the number of trials of each label that count so far."""
        stored = self.store.counts("collect")
        labels = {word: labels_of(word) for word in self.wanted.words}
        return {
            word: stored.get((label["label"], label.get("instance")), 0) for word, label in labels.items()
        }

    def following(self) -> str | None:
        """Return the label that comes next, or None if nothing is left."""
        counts = {word: n for word, n in self.counts().items() if word not in self._skipped}
        left = [word for word, n in counts.items() if n < self.wanted.each]
        if not left:
            return None
        number = min(counts[word] for word in left)
        order = list(self.wanted.words)
        random.Random(f"{self.wanted.seed} {number}").shuffle(order)
        return next(word for word in order if word in left and counts[word] == number)

    def run(self) -> None:
        """Collect until nothing is left or the operator stops.

        Raises ConfigError if the settings or the gripper differ from those of earlier trials, NoDevice if there is no
        gripper at the first grasp, SaveFailed if a trial could not be saved, and KeyboardInterrupt if the operator
        interrupts it; a grasp that was interrupted is stored as aborted, and no further one begins.
        """
        self._check(check_settings, self.settings_for(self.wanted.words[0], self.wanted.seed))
        self.say(HELP)
        while (word := self.following()) is not None:
            answer = self.ask(
                f"next: {word}  ({self.counts()[word] + 1} of {self.wanted.each})  [Enter u r s q ?] "
            )
            if answer is None or answer == "q":
                break
            if answer == "":
                if self.following() == word:
                    self._grasp(word)
                else:
                    self.say(f"somebody else has collected {word} meanwhile")
            elif answer == "u":
                self._undo(UNDONE)
            elif answer == "r":
                again = self._undo(RETAKEN)
                if again is not None:
                    self._grasp(again)
            elif answer == "s":
                self._skipped.add(word)
            else:
                self.say(HELP)

    def last(self) -> int | None:
        """Return the number of the newest trial of this collection that is not set aside.

        Other operators may collect into the same store; their trials are not this operator's to undo.
        """
        newest_first = reversed(self.collected)
        return next((name for name in newest_first if self.store.summary(name).set_aside is None), None)

    def _grasp(self, word: str) -> None:
        newest = self.store.page(set_aside=None, limit=1)
        settings = self.settings_for(word, self.wanted.seed + (newest[0].id if newest else 0))

        def opened(device: DeviceInfo) -> None:
            check_label(settings, device)
            self._check(check_device, device)

        try:
            grasp = record_grasp(
                self.store,
                settings,
                self.plugins,
                labels={**self.wanted.labels, **labels_of(word)},
                origin="collect",
                sinks=self.sinks,
                on_open=opened,
            )
        except NoDevice as error:
            if not self.collected:
                raise
            self.say(str(error))
            return
        if grasp.number is None:
            raise SaveFailed(grasp.problem)
        self.collected[grasp.number] = word
        try:
            self.say(self._report(word, grasp))
            self.show(word, grasp.trial)
            self.say("  ".join(f"{label} {n}/{self.wanted.each}" for label, n in self.counts().items()))
        finally:
            if grasp.interrupted:  # perhaps because the terminal has gone, so that nothing can be said
                raise KeyboardInterrupt

    def _report(self, word: str, grasp: RecordedTrial) -> str:
        trial = grasp.trial
        counted = trial.outcome not in (Outcome.ABORTED, Outcome.DEVICE_LOST, Outcome.RECOGNISED)
        reason = f": {trial.reason}" if trial.reason else ""
        line = f"trial {grasp.number}, {word}: {trial.outcome.words}{reason}"
        if not counted:
            line += "; it is stored, but does not count"
        if grasp.counts["dropped"]:
            line += f"; it does not count, as the recorder lost {grasp.counts['dropped']} messages"
        return line

    def _undo(self, why: str) -> str | None:
        """Set the last trial of this collection aside and return its label, or None if there is none."""
        last = self.last()
        if last is None:
            self.say(
                "there is no trial to undo: these keys act on trials of this session. `graspsense trials aside "
                f"{self.store.folder}#NUMBER` sets any other aside"
            )
            return None
        set_aside(self.store, [last], why)
        word = self.collected[last]
        self.say(f"trial {last}, {word}: set aside ({why})")
        return word

    def _check(self, check: Callable[[Store, StoredTrial, T], None], now: T) -> None:
        """Compare settings or gripper with those of the newest trial, if there is one and they may not differ."""
        earlier = None if self.changed else newest_grasp(self.store)
        if earlier is not None:
            check(self.store, earlier, now)
