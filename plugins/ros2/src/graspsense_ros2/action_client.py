"""The action of a gripper of others: goals are sent one after the other, and the newest replaces those before it."""

from __future__ import annotations

import threading
import uuid
from typing import Final, Literal

from attrs import frozen

from graspsense_ros2.action_server import CANCEL
from graspsense_ros2.message_types import BadMessage, decode, encode
from graspsense_ros2.node import Node, ServiceFailed

ActionType = Literal["GripperCommand", "ParallelGripperCommand"]
ANSWER_S: Final = 1.0
"""Longest wait for the answer to a goal."""
MOST_FAILURES: Final = 3
"""Goals in a row that may be refused or unanswered before the gripper is lost."""


@frozen
class Target:
    """Where the joint is to go, with which effort and speed; a speed of 0 is the gripper's own."""

    position: float
    effort: float
    speed: float


class GripperAction:
    """Sends goals to the action of a gripper, in a thread of its own so that no frame waits for an answer."""

    def __init__(self, node: Node, name: str, kind: ActionType, joint: str) -> None:
        self.name, self._kind, self._joint = name, kind, joint
        self._type = f"control_msgs/action/{kind}"
        self._send_goal = node.client(f"{name}/_action/send_goal", f"{self._type}_SendGoal")
        self._cancel_goal = node.client(f"{name}/_action/cancel_goal", CANCEL)
        self._changed = threading.Condition()
        self._wanted: Target | None = None
        self._ended = False
        self.goals = self.failures = 0
        """Goals that were accepted, and those in a row that were not."""
        self.said = ""
        """Why the last goal was not accepted."""
        self._thread = threading.Thread(target=self._send_wanted, daemon=True)
        self._thread.start()

    def want(self, target: Target) -> None:
        """Send this goal as soon as the one before it was answered."""
        with self._changed:
            self._wanted = target
            self._changed.notify()

    def send(self, target: Target) -> None:
        """Send a goal and wait for its answer. Raises ServiceFailed."""
        goal = {"goal_id": {"uuid": list(uuid.uuid4().bytes)}, "goal": {"command": self._command(target)}}
        answer = self._send_goal(encode(f"{self._type}_SendGoal_Request", goal), ANSWER_S)
        try:
            accepted = decode(f"{self._type}_SendGoal_Response", answer).accepted
        except BadMessage as error:
            raise ServiceFailed(f"{self.name} answers with what is no answer: {error}") from error
        if not accepted:
            raise ServiceFailed(f"{self.name} refuses the position {target.position:g}")
        self.goals += 1

    def cancel(self) -> None:
        """Cancel all goals. Raises ServiceFailed."""
        self._cancel_goal(encode(f"{CANCEL}_Request", {}), ANSWER_S)

    def end(self) -> None:
        """Send nothing more in the thread, and wait for it."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(2.0 * ANSWER_S)

    def _command(self, target: Target) -> dict[str, object]:
        if self._kind == "GripperCommand":
            return {"position": target.position, "max_effort": target.effort}
        joint = {"name": [self._joint], "position": [target.position], "effort": [target.effort]}
        return {**joint, "velocity": [target.speed]} if target.speed > 0.0 else joint

    def _send_wanted(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._ended or self._wanted is not None)
                target, self._wanted = self._wanted, None
                if self._ended:
                    return
            assert target is not None
            try:
                self.send(target)
                self.failures = 0
            except ServiceFailed as error:
                self.failures, self.said = self.failures + 1, str(error)
