"""`graspsense ros2`: a node that grasps, and moves the gripper, when other nodes ask for it."""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from math import isfinite
from typing import Any, Final, TypeVar

import click

from graspsense.gripper_api import GraspsenseError, LiveFeed, Pipeline, load_pipeline
from graspsense.plugin_api import DeviceLost, Trial
from graspsense_ros2.action_server import ActionServer, Goal
from graspsense_ros2.held_gripper import HeldGripper
from graspsense_ros2.message_types import decode, encode
from graspsense_ros2.middleware import Through, open_node
from graspsense_ros2.node import Node

GRASP: Final = "/graspsense/grasp"
GRIPPER_COMMAND: Final = "/graspsense/gripper_cmd"
TRIGGER: Final = "std_srvs/srv/Trigger"
ACTION: Final = "control_msgs/action/GripperCommand"
ResultT = TypeVar("ResultT")


@click.command(short_help="Be a ROS 2 node that grasps when it is asked.")
@click.option(
    "--pipeline", default="default", metavar="NAME|FILE", help="Name of a pipeline, or a .toml file."
)
@click.option("--gripper", metavar="NAME", help="Gripper: robotiq, pr2, ... (gripper.type)")
@click.option(
    "-o", "options", metavar="TABLE.KEY=VALUE", multiple=True, help="Set any other key. Can be repeated."
)
@click.option("--grasp", "grasps", is_flag=True, help=f"Offer the service {GRASP} ({TRIGGER}): one grasp.")
@click.option("--action", "moves", is_flag=True, help=f"Offer the action {GRIPPER_COMMAND} ({ACTION}).")
@click.option(
    "--through",
    type=click.Choice(["auto", "rclpy", "zenoh"]),
    default="auto",
    help="auto: rclpy where it can be imported, otherwise zenoh.",
)
def ros2(
    pipeline: str, gripper: str | None, options: tuple[str, ...], grasps: bool, moves: bool, through: Through
) -> None:
    """Offer a grasp as a service, and the gripper as an action, until Ctrl-C, which opens the gripper.

    The grasps are published as topics below /graspsense. Exit codes: 0 ended by Ctrl-C; 2 wrong settings.
    """
    if not (grasps or moves):
        raise click.UsageError("say what others may ask for: --grasp, --action, or both")
    chosen = [] if gripper is None else [f"gripper.type={gripper}"]
    loaded = load_pipeline(pipeline, options=[*chosen, *options])
    server = GripperServer(loaded)
    if moves:
        server.can_move()
    feed = LiveFeed("graspsense.live.observer_process", ["graspsense_ros2.sink:observe"])
    node = open_node("graspsense_gripper", through)
    try:
        server.offer(node, feed, grasps)
        for name, offered in ((GRASP, grasps), (GRIPPER_COMMAND, moves)):
            if offered:
                click.echo(f"offered: {name}", err=True)
        gripper = loaded.settings.gripper.component.qualified
        click.echo(f"waiting: gripper {gripper} is opened at the first request. Ctrl-C ends it", err=True)
        server.serve()
    except KeyboardInterrupt:
        click.echo("", err=True)
    finally:
        server.end()
        node.close()
        error = feed.close()
        if error:
            click.echo(f"topics: {error}", err=True)


class GripperServer:
    """Does what other nodes ask for, one thing after the other, in the thread of `serve`."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline
        self._held: HeldGripper | None = None
        self._jobs: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]]] = queue.SimpleQueue()
        self._grasping = threading.Lock()
        self._feed: LiveFeed | None = None
        self._stop_moving: Callable[[], None] = lambda: None

    def can_move(self) -> None:
        """Take goals too. Raises ConfigError if the gripper cannot move to a position."""
        self._held = HeldGripper(self._pipeline)

    def offer(self, node: Node, feed: LiveFeed, grasps: bool) -> None:
        """Offer the service and the action on this node."""
        self._feed = feed
        if grasps:
            node.service(GRASP, TRIGGER, self._answer_trigger)
        if self._held is not None:
            self._stop_moving = ActionServer(node, GRIPPER_COMMAND, ACTION, self._accepts, self._execute).stop

    def serve(self) -> None:
        """Do what is asked for until KeyboardInterrupt."""
        while True:
            ticking = self._held is not None and self._held.ticking
            try:
                done, job = self._jobs.get(block=not ticking)
            except queue.Empty:
                assert self._held is not None
                try:
                    self._held.tick()
                except DeviceLost as error:
                    click.echo(f"the gripper is lost: {error}", err=True)
                continue
            try:
                done.set_result(job())
            except BaseException:
                done.set_exception(RuntimeError("the node was stopped"))
                raise

    def end(self) -> None:
        """Open the gripper if it is held."""
        self._stop_moving()
        try:
            if self._held is not None:
                self._held.release()
        except GraspsenseError as error:
            click.echo(f"the gripper could not be opened: {error}", err=True)

    def _answer_trigger(self, request: bytes) -> bytes:
        """Wait for a grasp, and return its outcome, its prediction and its features as JSON."""
        decode(f"{TRIGGER}_Request", request)
        if not self._grasping.acquire(blocking=False):
            return encode(f"{TRIGGER}_Response", {"success": False, "message": "a grasp goes on already"})
        try:
            self._stop_moving()
            answer = self._done(self._grasp)
        finally:
            self._grasping.release()
        return encode(f"{TRIGGER}_Response", answer)

    def _grasp(self) -> Mapping[str, Any]:
        assert self._feed is not None
        try:
            if self._held is not None:
                self._held.release()
            trial = self._pipeline.grasp(sinks=[self._feed])
        except GraspsenseError as error:
            click.echo(f"no grasp: {error}", err=True)
            return {"success": False, "message": str(error)}
        self._feed.finished(trial)
        click.echo(f"grasp: {trial.outcome.words}", err=True)
        return {
            "success": trial.outcome.name not in ("ABORTED", "DEVICE_LOST"),
            "message": json.dumps(_told(trial)),
        }

    def _accepts(self, goal: Any) -> bool:
        """Return whether a goal can be executed: a gap and an effort that are numbers, while no grasp goes on."""
        command = goal.command
        numbers = (command.position, command.max_effort)
        return all(isfinite(number) and number >= 0.0 for number in numbers) and not self._grasping.locked()

    def _execute(self, goal: Goal) -> tuple[bool, Mapping[str, Any]]:
        return self._done(lambda: self._move(goal))

    def _move(self, goal: Goal) -> tuple[bool, Mapping[str, Any]]:
        assert self._held is not None
        if goal.stop.is_set():
            return False, {}
        try:
            result = self._held.move(goal)
        except GraspsenseError as error:
            click.echo(f"a goal failed: {error}", err=True)
            return False, {}
        # As in ros2_control, fingers that hold an object have done what was asked for.
        return (result.reached or result.stalled) and not goal.stop.is_set(), result.values()

    def _done(self, job: Callable[[], ResultT]) -> ResultT:
        """Do a job in the thread of `serve`, and return its result. Raises RuntimeError if there is none."""
        done: Future[ResultT] = Future()
        self._jobs.put((done, job))
        return done.result()


def _told(trial: Trial) -> dict[str, Any]:
    """Return what a caller is told of a grasp, as JSON values."""
    features: Sequence[float] = trial.features.values
    return {
        "outcome": trial.outcome.words,
        "reason": trial.reason,
        "features": {
            name: value if isfinite(value) else None
            for name, value in zip(trial.features.names, features, strict=True)
        },
        "prediction": None if trial.prediction is None else trial.prediction.in_words,
        "counts": dict(trial.counts),
    }
