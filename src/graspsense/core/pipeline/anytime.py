"""Recognition while a grasp goes on: a prediction at each checkpoint of the model, which can end the squeeze.

On a virtual clock the prediction is computed within the tick, since no time passes. A real gripper does not wait: there
a thread computes it beside the control loop, and the ticks after it pick it up. A prediction that takes longer than to
the next checkpoint makes that checkpoint be skipped; it never makes a tick wait.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from math import inf
from typing import Any, Final

from graspsense.core.components.caller import set_option
from graspsense.core.components.roles import FeatureSet
from graspsense.core.grasp.sinks import Tell
from graspsense.core.learn.model import Model, differences_from
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import FAILURES, ConfigError, named
from graspsense.core.values.features import CheckpointPrediction, Features, Prediction
from graspsense.core.values.signals import HOLD, SQUEEZE, Frame
from graspsense.core.values.trace import TraceRecorder, trace_of

SWITCH_S: Final = 1e-4
"""Time after which the thread gives the interpreter back to the control loop that waits for it; usually 5 ms."""


class Anytime:
    """Predicts at the checkpoints of a model. With `stops`, a prediction set with one label ends the squeeze."""

    def __init__(
        self, model: Model, feature_set: FeatureSet[Any], settings: Settings, *, stops: bool
    ) -> None:
        self.predictions: list[CheckpointPrediction] = []
        """Those of this grasp, in order."""
        self._model, self._feature_set, self._settings = model, feature_set, settings
        self._stops = stops
        self._left = list(model.checkpoints)
        self._contact_s: float | None = None
        self._due_s = -inf
        self._pool: ThreadPoolExecutor | None = None
        self._running: Future[tuple[Features, Prediction]] | None = None
        self._running_after_s = 0.0
        self._switch_s = sys.getswitchinterval()
        self._recorder: TraceRecorder | None = None

    def begin(self, recorder: TraceRecorder, info: DeviceInfo, tell: Tell) -> None:
        """Prepare before the gripper moves: on a device, what is imported or compiled at first use is used once."""
        self._recorder, self._info, self._tell = recorder, info, tell
        if info.clock == "device":
            with suppress(Exception):  # it is reported at the first checkpoint
                for _, model in self._left:
                    model.predict(self._feature_set.extract(trace_of([], [], [], [])), None, None)
            self._pool = ThreadPoolExecutor(1, "checkpoints")
            self._pool.submit(int).result()  # starts the thread
            sys.setswitchinterval(SWITCH_S)

    def watch(self, frame: Frame, phase: int) -> str:
        """Return the reason to stop the squeeze after this tick; empty if it goes on."""
        if (phase != SQUEEZE and phase != HOLD) or (frame.t_s < self._due_s and self._running is None):
            return ""
        if self._contact_s is None:
            self._contact_s = frame.t_s
            self._set_due()
        running, reason = self._running, ""
        if running is not None and running.done():
            self._running = None
            reason = self._receive(frame.t_s, phase, self._running_after_s, running.result)
        if not reason and frame.t_s >= self._due_s:
            reason = self._checkpoint(frame.t_s, phase)
        return reason

    @property
    def computing(self) -> bool:
        """Whether a thread computes a prediction at this moment."""
        return self._running is not None and not self._running.done()

    def end(self) -> None:
        """Wait for a prediction that is still running, which is dropped, and let the ticks go."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            sys.setswitchinterval(self._switch_s)
        self._recorder = self._running = None

    def _set_due(self) -> None:
        assert self._contact_s is not None
        self._due_s = self._contact_s + self._left[0][0] if self._left else inf

    def _checkpoint(self, t_s: float, phase: int) -> str:
        after_s, model = self._left.pop(0)
        self._set_due()
        if self._running is not None:
            skipped = (
                f"{after_s:g} s after the contact: no prediction, since the last one is still being made"
            )
            self._tell(t_s, phase, skipped, None)
            return ""
        compute = self._prediction_of(after_s, model)
        if self._pool is None:
            return self._receive(t_s, phase, after_s, compute)
        self._running_after_s = after_s
        self._running = self._pool.submit(compute)
        return ""

    def _prediction_of(self, after_s: float, model: Model) -> Callable[[], tuple[Features, Prediction]]:
        """Return the prediction of the ticks so far, to be computed in this thread or in another one."""
        recorder, contact_s = self._recorder, self._contact_s
        assert recorder is not None
        assert contact_s is not None
        n, m = len(recorder.frames), len(recorder.images)

        def compute() -> tuple[Features, Prediction]:
            trace = recorder.first_ticks(n, m).until(contact_s + after_s)
            features = self._feature_set.extract(trace)
            return features, model.predict(features, self._settings, self._info)

        return compute

    def _receive(
        self, t_s: float, phase: int, after_s: float, result: Callable[[], tuple[Features, Prediction]]
    ) -> str:
        """Report a prediction; return the reason to stop if it is sure. A failure must not end the grasp."""
        try:
            features, prediction = result()
        except FAILURES as error:
            failed = f"{after_s:g} s after the contact: the prediction failed: {named(error)}"
            self._tell(t_s, phase, failed, None)
            return ""
        made = CheckpointPrediction(after_s=after_s, t_s=t_s, features=features, prediction=prediction)
        self.predictions.append(made)
        self._tell(t_s, phase, made.words, prediction)
        return made.words if self._stops and made.sure else ""


def anytime_of(model: Model | None, feature_set: FeatureSet[Any], settings: Settings) -> Anytime | None:
    """Return what predicts during a grasp with these settings; None for a model without checkpoints.

    Raises ConfigError if the squeeze is to stop when sure, and no model with prediction sets can say so.
    """
    stops = settings.run.stop_when_sure
    if model is None or not model.checkpoints:
        if not stops:
            return None
        what = "there is no classifier" if model is None else f"model {model.name!r} has no checkpoints"
        raise ConfigError(
            f"run.stop_when_sure: {what}, so nothing is predicted before the grasp ends. Train a model with "
            "graspsense train ... --checkpoints 0.1,0.2,0.4 --out FILE.json, and name it: "
            f"{set_option('classifier.model=FILE.json')}. Or let the grasp go on: "
            f"{set_option('run.stop_when_sure=false')}"
        )
    if stops and not any(part.sets is not None and part.sets.thresholds for _, part in model.checkpoints):
        sets = model.checkpoints[0][1].sets
        reason = sets.reason if sets is not None else "they are not calibrated"
        raise ConfigError(
            f"run.stop_when_sure: model {model.name!r} has no prediction sets at its checkpoints ({reason})"
        )
    if stops and (differences := [*differences_from(model.provenance, settings)]):
        raise ConfigError(
            f"run.stop_when_sure: the sets of model {model.name!r} were not measured under these settings, so nothing "
            f"is sure: {differences[0]}. Train a model with these settings, or let the grasp go on: "
            f"{set_option('run.stop_when_sure=false')}"
        )
    return Anytime(model, feature_set, settings, stops=stops)
