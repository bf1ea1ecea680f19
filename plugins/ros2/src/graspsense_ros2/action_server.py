"""An action that others call: its three services and two topics, as rcl_action names them.

A new goal ends the one before it, as in the gripper controllers of ros2_control.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from attrs import define, field

from graspsense_ros2.message_types import decode, encode
from graspsense_ros2.node import Node

CANCEL: Final = "action_msgs/srv/CancelGoal"
STATUS: Final = "action_msgs/msg/GoalStatusArray"
UNKNOWN, EXECUTING, SUCCEEDED, CANCELED, ABORTED = 0, 2, 4, 5, 6
"""States of a goal (action_msgs/msg/GoalStatus)."""
_NONE_CANCELED, _UNKNOWN_GOAL, _GOAL_ENDED = 1, 2, 3
"""Return codes of CancelGoal beside 0."""
KEPT_GOALS: Final = 32
"""Goals whose results can be asked for."""

Values = Mapping[str, Any]


@define(eq=False)
class Goal:
    """A goal that was accepted: what is asked for, its state, and its result once `done` is set."""

    uuid: bytes
    asked: Any
    publish: Callable[[Values], None]
    """Send feedback."""
    status: int = EXECUTING
    result: Values = field(factory=dict)
    stop: threading.Event = field(factory=threading.Event)
    """Set where the goal is cancelled, or another one takes its place."""
    canceled: bool = False
    done: threading.Event = field(factory=threading.Event)


Execute = Callable[[Goal], tuple[bool, Values]]
"""Does what a goal asks for until `goal.stop` is set, and returns whether it was reached, and the result."""


class ActionServer:
    """An action on a node. `accept` says whether a goal can be executed, `execute` does it in a thread of its own."""

    def __init__(
        self, node: Node, name: str, type_name: str, accept: Callable[[Any], bool], execute: Execute
    ) -> None:
        self._type, self._accept, self._execute = type_name, accept, execute
        self._lock = threading.Lock()
        self._running = threading.Lock()
        self._goals: dict[bytes, Goal] = {}
        self._feedback = node.publisher(f"{name}/_action/feedback", f"{type_name}_FeedbackMessage")
        self._status = node.publisher(f"{name}/_action/status", STATUS, latched=True)
        node.service(f"{name}/_action/send_goal", f"{type_name}_SendGoal", self._send_goal)
        node.service(f"{name}/_action/get_result", f"{type_name}_GetResult", self._get_result)
        node.service(f"{name}/_action/cancel_goal", CANCEL, self._cancel)

    def stop(self) -> None:
        """End the goal that is executed."""
        with self._lock:
            for goal in self._goals.values():
                goal.stop.set()

    def _send_goal(self, data: bytes) -> bytes:
        request = decode(f"{self._type}_SendGoal_Request", data)
        uuid = bytes(request.goal_id.uuid)
        with self._lock:
            accepted = uuid not in self._goals and self._accept(request.goal)
            if accepted:
                for earlier in self._goals.values():
                    earlier.stop.set()
                goal = Goal(uuid, request.goal, lambda values: self._tell(uuid, values))
                self._goals[uuid] = goal
                while len(self._goals) > KEPT_GOALS:
                    del self._goals[next(iter(self._goals))]
        if accepted:
            threading.Thread(target=self._run, args=(goal,), daemon=True).start()
        return encode(f"{self._type}_SendGoal_Response", {"accepted": accepted})

    def _run(self, goal: Goal) -> None:
        with self._running:
            self._tell_status()
            reached = False
            try:
                reached, goal.result = self._execute(goal)
            finally:
                goal.status = SUCCEEDED if reached else CANCELED if goal.canceled else ABORTED
                goal.done.set()
                self._tell_status()

    def _get_result(self, data: bytes) -> bytes:
        uuid = bytes(decode(f"{self._type}_GetResult_Request", data).goal_id.uuid)
        response = f"{self._type}_GetResult_Response"
        goal = self._goals.get(uuid)
        if goal is None:
            return encode(response, {"status": UNKNOWN})
        goal.done.wait()
        return encode(response, {"status": goal.status, "result": goal.result})

    def _cancel(self, data: bytes) -> bytes:
        """Cancel the goal of this id, or with an id of zeros those accepted until the stamp; a stamp of zero is any."""
        uuid = bytes(decode(f"{CANCEL}_Request", data).goal_info.goal_id.uuid)
        with self._lock:
            if any(uuid) and uuid not in self._goals:
                return encode(f"{CANCEL}_Response", {"return_code": _UNKNOWN_GOAL})
            asked = [self._goals[uuid]] if any(uuid) else list(self._goals.values())
            running = [goal for goal in asked if not goal.done.is_set() and not goal.stop.is_set()]
            for goal in running:
                goal.canceled = True
                goal.stop.set()
        code = 0 if running else _GOAL_ENDED if any(uuid) else _NONE_CANCELED
        infos = [{"goal_id": {"uuid": list(goal.uuid)}} for goal in running]
        return encode(f"{CANCEL}_Response", {"return_code": code, "goals_canceling": infos})

    def _tell(self, uuid: bytes, values: Values) -> None:
        feedback = {"goal_id": {"uuid": list(uuid)}, "feedback": values}
        self._feedback(encode(f"{self._type}_FeedbackMessage", feedback))

    def _tell_status(self) -> None:
        with self._lock:
            states = [
                {"goal_info": {"goal_id": {"uuid": list(goal.uuid)}}, "status": goal.status}
                for goal in self._goals.values()
            ]
        self._status(encode(STATUS, {"status_list": states}))
