"""Collecting labelled trials with an operator: what comes next, what was said of it, and what is left to do.

All there is to know of a collection stands in its store, so that it goes on after a kill where it was. Things are
taken in rounds, each round in an order of its own drawn from the seed: classes that are recorded one after the
other differ by the time of day as well as by what they are.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from attrs import define, field, frozen

from graspsense.core.errors import ConfigError, NoDevice
from graspsense.core.signals import Outcome
from graspsense.recording.provenance import recipe
from graspsense.recording.recorder import NotKept
from graspsense.store.labels import labels_of
from graspsense.store.record_grasp import KeptGrasp, kept_grasp
from graspsense.store.store import Kept, Listed, Store

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.plugins import Plugins
    from graspsense.core.roles import DeviceInfo
    from graspsense.core.runner import Sink

HELP: Final = (
    "Enter: grasp it   u: undo the last   r: take the last one again   s: not this one today   q: stop"
)
UNDONE: Final = "undone by the operator"
RETAKEN: Final = "taken again"
_COMPARED: Final = ("name", "serial", "calibration")


@frozen(kw_only=True)
class Wanted:
    """What is to be collected: words as `labels_of` takes them, and how many trials of each."""

    words: tuple[str, ...]
    each: int
    seed: int = 0
    labels: Mapping[str, str] = field(factory=dict)
    """Further labels of every trial, such as the operator's name."""

    def __attrs_post_init__(self) -> None:
        if not self.words:
            raise ConfigError(
                "nothing to collect: name what there is, as in --labels can:full_open,can:empty_open"
            )
        if len(set(self.words)) < len(self.words):
            raise ConfigError(f"a label is named twice: {', '.join(self.words)}")
        if self.each < 1:
            raise ConfigError(f"{self.each} trials of each: give at least 1")
        for word in self.words:
            labels_of(word)


@define(eq=False)
class Collection:
    """A collection under way in a store.

    `settings_for` gives the settings of the grasp of a word, with a seed. `ask` puts a question and returns the
    answer, None where there will be no more; `say` tells something. `changed` allows another gripper or other
    settings than those of the trials before.
    """

    store: Store
    wanted: Wanted
    plugins: Plugins
    settings_for: Callable[[str, int], Settings]
    ask: Callable[[str], str | None]
    say: Callable[[str], None]
    changed: bool = False
    sinks: Sequence[Sink] = ()
    stopping: bool = False
    """Set it to end after the grasp that is under way."""
    kept: list[int] = field(factory=list, init=False)
    _skipped: set[str] = field(factory=set, init=False)

    def counts(self) -> dict[str, int]:
        """Return how many trials of each word count so far."""
        have = self.store.counts("collect")
        found = dict.fromkeys(self.wanted.words, 0)
        for word in found:
            labels = labels_of(word)
            label, instance = labels["label"], labels.get("instance")
            found[word] = have.get((label, instance), 0)
        return found

    def following(self) -> str | None:
        """Return the word that comes next, None where nothing is left to do."""
        counts = {word: n for word, n in self.counts().items() if word not in self._skipped}
        left = [word for word, n in counts.items() if n < self.wanted.each]
        if not left:
            return None
        number = min(counts[word] for word in left)
        order = list(self.wanted.words)
        random.Random(f"{self.wanted.seed} {number}").shuffle(order)
        return next(word for word in order if word in left and counts[word] == number)

    def run(self) -> None:
        """Collect until everything is there or the operator stops.

        Raises ConfigError where the settings or the gripper are not those of the trials before, NoDevice where
        there is no gripper to begin with, NotKept where a trial could not be kept.
        """
        self._check_settings()
        while not self.stopping:
            word = self.following()
            if word is None:
                break
            answer = self.ask(f"next: {word}  ({self.counts()[word] + 1} of {self.wanted.each})  [?] ")
            if answer is None or answer == "q":
                break
            if answer == "":
                self._grasp(word)
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

    def last(self) -> Listed | None:
        """Return the newest collected trial that was not set aside."""
        newest = self.store.page(origin="collect", limit=1)
        return newest[0] if newest else None

    def _grasp(self, word: str) -> None:
        settings = self.settings_for(word, self.wanted.seed + self._number_of_trials())
        try:
            grasp = kept_grasp(
                self.store,
                settings,
                self.plugins,
                labels={**self.wanted.labels, **labels_of(word)},
                origin="collect",
                sinks=self.sinks,
                on_open=self._check_device,
            )
        except NoDevice as error:
            if not self.kept:
                raise
            self.say(str(error))
            return
        if grasp.number is None:
            raise NotKept(grasp.problem)
        self.kept.append(grasp.number)
        self.say(self._told(word, grasp))

    def _told(self, word: str, grasp: KeptGrasp) -> str:
        trial, counts = grasp.trial, self.counts()
        counted = trial.outcome not in (Outcome.ABORTED, Outcome.DEVICE_LOST)
        reason = f": {trial.reason}" if trial.reason else ""
        line = f"trial {grasp.number}, {word}: {trial.outcome.words}{reason}"
        if not counted:
            line += "; it is kept, but does not count"
        if grasp.counts["dropped"]:
            line += f"; it does not count: the recorder lost {grasp.counts['dropped']} messages"
        so_far = "  ".join(f"{one} {n}/{self.wanted.each}" for one, n in counts.items())
        return f"{line}\n  {so_far}"

    def _undo(self, why: str) -> str | None:
        """Set the last collected trial aside and return its word, None where there is none."""
        last = self.last()
        if last is None:
            self.say("there is no trial to undo")
            return None
        self.store.set_aside(last.id, why)
        number = (last.instance or "").partition("#")[2]
        word = f"{last.label}#{number}" if number else str(last.label)
        self.say(f"trial {last.id}, {word}: set aside ({why})")
        return word

    def _number_of_trials(self) -> int:
        newest = self.store.page(set_aside=None, limit=1)
        return newest[0].id if newest else 0

    def _before(self) -> Kept | None:
        last = self.last()
        return None if last is None or self.changed else self.store.trial(last.id)

    def _check_settings(self) -> None:
        before = self._before()
        if before is None:
            return
        now = recipe(self.settings_for(self.wanted.words[0], self.wanted.seed).values)
        then = before.recipe
        differ = [
            f"{table}.{key} was {then.get(table, {}).get(key)!r} and is {now.get(table, {}).get(key)!r}"
            for table in dict.fromkeys((*then, *now))
            for key in dict.fromkeys((*then.get(table, {}), *now.get(table, {})))
            if _plain(then.get(table, {}).get(key)) != _plain(now.get(table, {}).get(key))
        ]
        if differ:
            raise ConfigError(self._refusal("settings", before, differ))

    def _check_device(self, device: DeviceInfo) -> None:
        before = self._before()
        if before is None:
            return
        now: dict[str, Any] = {
            "name": device.name,
            "serial": device.serial,
            "calibration": dict(device.calibration),
        }
        differ = [
            f"{name} was {before.device.get(name)!r} and is {now[name]!r}"
            for name in _COMPARED
            if before.device.get(name) != now[name]
        ]
        if differ:
            raise ConfigError(self._refusal("gripper", before, differ))

    def _refusal(self, what: str, before: Kept, differ: Sequence[str]) -> str:
        lines = "".join(f"\n  {one}" for one in differ)
        return (
            f"the {what} differ from trial {before.listed.id} of the store in {self.store.folder}:{lines}\n"
            "  Put back what was, collect into another store, or say --changed if it is meant"
        )


def _plain(value: Any) -> Any:
    """Return a value as TOML has it: a list for a tuple."""
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items() if one is not None}
    return value
