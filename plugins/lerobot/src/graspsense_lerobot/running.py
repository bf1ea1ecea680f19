"""A grasp while another program makes it: from one observation after the other its phase, events and predictions."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from math import inf, isfinite, nan
from typing import Any, Final, NamedTuple, final

from graspsense.gripper_api import Protection, anytime_of, load_pipeline, model_for
from graspsense.plugin_api import (
    EFFORT,
    HOLD,
    NO_PADS,
    RELEASE,
    RUNNING,
    SQUEEZE,
    STEADY,
    VELOCITY,
    Channel,
    Command,
    ConfigError,
    DeviceInfo,
    Frame,
    Prediction,
    Reading,
)
from graspsense.simulator_api import CHANNELS
from graspsense.testing_api import TraceRecorder
from graspsense_lerobot.names import Meaning, meaning_of
from graspsense_lerobot.place import PlaceOptions

EVENTS: Final = ("nothing", "contact", "rest", "end")
"""What the numbers of events mean."""
KNOWN: Final = ("gap", "velocity", "force_left", "force_right")
WIDEST_M: Final = 0.5
UNKNOWN: Final = Command(EFFORT, nan, inf, inf)
"""What the gripper is commanded, which another program does."""
OF_TIME: Final = ("clock", "frames")
"""How the faults of the time begin, which here is that of this computer or of a count."""


class Running(NamedTuple):
    """A grasp after an observation, in numbers.

    `phase` and `outcome` are those of `Phase` and `Outcome`, `event` is one of `EVENTS`. `prediction` is the number of
    the class, counted from 1, and 0 for none. `certainty` is how often such answers are right, from `certainty_low` to
    `certainty_high` at 95 %; they are NaN where that was not measured.
    """

    phase: int
    event: int
    outcome: int
    prediction: int
    certainty: float
    certainty_low: float
    certainty_high: float


@final
class FollowedGrasp:
    """Follows the grasps in observations by the controller, the features and the model of a pipeline.

    The controller only tells the phases: what it commands goes nowhere. Raises ConfigError if the pipeline cannot be
    used.
    """

    def __init__(self, pipeline: str, options: Sequence[str], given: PlaceOptions) -> None:
        loaded = load_pipeline(pipeline, options=options)
        self._settings, self._given = loaded.settings, given
        self._model = model_for(loaded.settings, loaded.plugins)
        self._features: Any = loaded.settings.features.create()
        self._law: Any = loaded.settings.controller.create()
        lacking = [require.name for require in self._features.requires if require.name not in KNOWN]
        if lacking:
            raise ConfigError(
                f"the features of this pipeline need {', '.join(lacking)}; from observations come {', '.join(KNOWN)}"
            )
        self._contact_n = float(self._law.contact_force_n())
        self.classes = () if self._model is None else tuple(self._model.classifier.classes())
        """The classes, in the order of their numbers."""
        self.prediction: Prediction | None = None
        """The last prediction of this grasp, with its reasons."""
        self.missing = 0
        """The number of observations that lacked a number."""
        self.reset()

    def reset(self) -> None:
        """Begin anew, as at the beginning of an episode."""
        self._meaning: Meaning | None = None
        self._frames = 0
        self._last: Frame | None = None
        self._now = Running(int(self._law.init().phase), 0, RUNNING, prediction=0, **_certainty(None))
        self._begin()

    def add(self, numbers: Mapping[str, float]) -> Running:
        """Return the grasp after this observation. Raises ConfigError if gap or force are not in it."""
        t_s = self._frames / self._given.fps if self._given.fps else time.monotonic()
        self._frames += 1
        frame = self._frame(t_s, numbers)
        if frame is None:
            self.missing += 1
            self._now = self._now._replace(event=0)
            return self._now
        self._last = frame
        free = max(frame.force_left_n, frame.force_right_n) < self._contact_n
        if self._over and free:
            self._begin()
        if not self._over:
            self._follow(Reading(frame, NO_PADS))
        else:
            self._now = self._now._replace(phase=RELEASE, event=0)
        return self._now

    @property
    def faults(self) -> list[str]:
        """The faults of the sensors that were seen in this grasp, in words."""
        return [words for words in self._protection.warnings if not words.startswith(OF_TIME)]

    def _begin(self) -> None:
        self._recorder, self._over, self._hold_until_s = TraceRecorder(), False, inf
        self._state = self._law.init()
        device = _observations(self._given.fps or 30.0)
        self._protection = Protection(device, self._law, self._settings.run, lambda fault: None)
        self._anytime = (
            None if self._model is None else anytime_of(self._model, self._features, self._settings)
        )
        if self._anytime is not None:
            self._anytime.begin(self._recorder, device, _nobody)
        self.prediction = None

    def _follow(self, reading: Reading) -> None:
        frame, earlier_phase = reading.frame, int(self._state.phase)
        if self._hold_until_s == inf:
            command, self._state = self._law.step(self._law.params(), self._state, reading)
        else:
            command = Command(VELOCITY, 0.0, inf, inf)
        phase, outcome = int(self._state.phase), int(self._state.outcome)
        self._recorder.add(reading, phase, command)
        self._protection.limit(reading, phase, UNKNOWN)
        self._protection.watch(reading, phase, UNKNOWN)
        event = 0
        if phase != earlier_phase:
            event = {SQUEEZE: 1, HOLD: 2}.get(phase, 0)
        if self._anytime is not None:
            self._anytime.watch(frame, phase)
            if self._anytime.predictions:
                self.prediction = self._anytime.predictions[-1].prediction
        if outcome != RUNNING and self._hold_until_s == inf:
            self._hold_until_s = frame.t_s + (self._settings.run.hold_s if outcome == STEADY else 0.0)
        if frame.t_s >= self._hold_until_s:
            event, self._over = 3, True
            if self._model is not None:
                self.prediction = self._model.predict(
                    self._features.extract(self._recorder.trace()), None, None
                )
        if self.prediction is not None and self.faults:
            self.prediction = self.prediction.without_certainty("a fault was seen in this grasp")
        made = self.prediction
        number = self.classes.index(made.label) + 1 if made is not None and made.label in self.classes else 0
        self._now = Running(phase, event, outcome, prediction=number, **_certainty(made))

    def _frame(self, t_s: float, numbers: Mapping[str, float]) -> Frame | None:
        """Return the frame of these numbers, None if one of them is missing. Raises ConfigError."""
        given = self._given
        if self._meaning is None:
            self._meaning = self._understood(numbers)
        meaning = self._meaning
        sides: list[tuple[str, ...]] = [(name,) for name in meaning.forces] or [
            cells.normal for cells in meaning.arrays
        ]
        try:
            gap = float(numbers[meaning.gap[0]])
            forces = [abs(sum(float(numbers[name]) for name in names)) for names in sides]
        except KeyError:
            return None
        if not all(map(isfinite, (gap, *forces))):
            return None
        scale = given.force_n_per_unit or 1.0
        gap_m = gap if given.gap_m_per_unit is None else given.gap_m_per_unit * (gap - given.gap_zero)
        if abs(gap_m) > WIDEST_M:
            raise ConfigError(
                f"the gap {meaning.gap[0]} is {gap_m:g}, which is not in metres: give gap_m_per_unit, and gap_zero"
            )
        left = scale * forces[0]
        right = scale * sum(forces[1:]) / (len(forces) - 1) if len(forces) > 1 else left
        dt_s = 0.0 if self._last is None else t_s - self._last.t_s
        velocity = (gap_m - self._last.gap_m) / dt_s if self._last is not None and dt_s > 0.0 else 0.0
        return Frame(
            t_s=t_s,
            dt_s=dt_s,
            gap_m=gap_m,
            velocity_m_s=velocity,
            force_left_n=left,
            force_right_n=right,
        )

    def _understood(self, numbers: Mapping[str, float]) -> Meaning:
        """Return the names of gap and forces, as the reader of data sets finds them. Raises ConfigError."""
        meaning = meaning_of(numbers, self._given.gap, self._given.force)
        gap, forces = meaning.gap[:1], meaning.felt_by(has_arrays=bool(meaning.arrays))
        lacking = [name for name in (*gap, *forces) if name not in numbers]
        if not gap or lacking or not (forces or meaning.arrays):
            raise ConfigError(
                f"no gap or no force in the observations (gap={', '.join(gap) or 'none'}, "
                f"force={', '.join(forces) or 'none'}): name them, as in gap=NAME&force=NAME. There are "
                f"{', '.join(list(numbers)[:12])}"
            )
        return Meaning(gap=gap, forces=forces, arrays=meaning.arrays)


def _observations(rate_hz: float) -> DeviceInfo:
    """Return what stands for the gripper: predictions are computed within the observation."""
    return DeviceInfo(
        name="observations",
        clock="virtual",
        rate_hz=rate_hz,
        effort_limit_n=inf,
        speed_limit_m_s=inf,
        opening=None,
        relaxed=Command(VELOCITY, 0.0, inf, inf),
        channels=tuple(Channel(name, CHANNELS[name], rate_hz) for name in KNOWN),
    )


def _certainty(made: Prediction | None) -> dict[str, float]:
    """Return the certainty of a prediction and the ends of its interval, NaN where they were not measured."""
    certainty = None if made is None else made.certainty
    if made is None or certainty is None:
        return dict.fromkeys(("certainty", "certainty_low", "certainty_high"), nan)
    low, high = made.certainty_interval or (nan, nan)
    return {"certainty": certainty, "certainty_low": low, "certainty_high": high}


def _nobody(t_s: float, phase: int, words: str, prediction: Prediction | None) -> None:
    """Receive what is told of a checkpoint, which the caller reads from the numbers."""
