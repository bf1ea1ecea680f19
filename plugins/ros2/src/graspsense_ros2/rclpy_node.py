"""A ROS 2 node through rclpy, where ROS is installed: the same names, types and bytes as through zenoh."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, Final

from graspsense.plugin_api import ConfigError
from graspsense_ros2.names import absolute
from graspsense_ros2.node import MOST_REQUESTS, ServiceFailed

DEPTH: Final = 10_000
"""Messages that wait for a subscriber: those of ten seconds, since ticks are published in bursts."""
_OF_ACTIONS: Final = {
    "SendGoal": "SendGoalService",
    "GetResult": "GetResultService",
    "FeedbackMessage": "FeedbackMessage",
}
"""The end of the name of a type that belongs to an action, and the name of its class."""


class RclpyNode:
    """A node with an executor of its own. Raises ConfigError if rclpy cannot be imported."""

    def __init__(self, name: str) -> None:
        try:
            import rclpy
            from rclpy.callback_groups import ReentrantCallbackGroup
            from rclpy.executors import MultiThreadedExecutor
            from rclpy.signals import SignalHandlerOptions
        except ImportError as error:
            raise ConfigError(
                f"rclpy cannot be imported: {error}. Source the setup file of your ROS 2, or go through zenoh"
            ) from error
        self._context = rclpy.Context()
        # Ctrl-C has to open the gripper, so it is not for ROS.
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(name, context=self._context)
        self._group = ReentrantCallbackGroup()
        self._executor = MultiThreadedExecutor(MOST_REQUESTS, context=self._context)
        self._executor.add_node(self._node)
        self._spinning = threading.Thread(target=self._executor.spin, daemon=True)
        self._spinning.start()

    def publisher(self, topic: str, type_name: str, latched: bool = False) -> Callable[[bytes], None]:
        """Return what publishes a message; a latched topic keeps its last one for who comes later."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        quality = QoSProfile(depth=1 if latched else DEPTH)
        if latched:
            quality.durability = DurabilityPolicy.TRANSIENT_LOCAL
        publish: Callable[[bytes], None] = self._node.create_publisher(
            _class_of(type_name), absolute(topic), quality
        ).publish
        return publish

    def subscribe(self, topic: str, type_name: str, take: Callable[[bytes], None]) -> None:
        """Call `take` with each message of a topic."""
        from rclpy.qos import qos_profile_sensor_data

        # Publishers of every quality match this one.
        self._node.create_subscription(
            _class_of(type_name),
            absolute(topic),
            take,
            qos_profile_sensor_data,
            callback_group=self._group,
            raw=True,
        )

    def types_of(self, topic: str) -> Sequence[str]:
        """Return the types that a topic is published with."""
        return tuple(info.topic_type for info in self._node.get_publishers_info_by_topic(absolute(topic)))

    def service(self, name: str, type_name: str, answer: Callable[[bytes], bytes]) -> None:
        """Answer each request; one for which `answer` raises gets an empty response, which says no."""
        from rclpy.serialization import deserialize_message, serialize_message

        service = _class_of(type_name)

        def call(request: Any, response: Any) -> Any:
            try:
                return deserialize_message(answer(serialize_message(request)), service.Response)
            except Exception as error:
                self._node.get_logger().error(f"{name}: {error}")
                return response

        self._node.create_service(service, absolute(name), call, callback_group=self._group)

    def client(self, name: str, type_name: str) -> Callable[[bytes, float], bytes]:
        """Return what sends a request and waits so many seconds for the answer. It raises ServiceFailed."""
        from rclpy.serialization import deserialize_message, serialize_message

        service = _class_of(type_name)
        client = self._node.create_client(service, absolute(name), callback_group=self._group)

        def ask(request: bytes, timeout_s: float) -> bytes:
            if not client.wait_for_service(timeout_sec=timeout_s):
                raise ServiceFailed(f"{name} does not answer")
            answered = threading.Event()
            future = client.call_async(deserialize_message(request, service.Request))
            future.add_done_callback(lambda _: answered.set())
            if not answered.wait(timeout_s):
                raise ServiceFailed(f"{name} does not answer")
            return bytes(serialize_message(future.result()))

        return ask

    def close(self) -> None:
        """Leave the network."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def _class_of(type_name: str) -> Any:
    """Return the class of a message, of a service, or of a part of an action. Raises ConfigError."""
    package, group, name = type_name.split("/")
    whole, _, part = name.rpartition("_")
    try:
        module = import_module(f"{package}.{group}")
        if group == "action" and part in _OF_ACTIONS:
            return getattr(getattr(module, whole).Impl, _OF_ACTIONS[part])
        return getattr(module, name)
    except (ImportError, AttributeError) as error:
        raise ConfigError(
            f"ROS has no type {type_name}: {error}. Install its package, as ros-jazzy-{package.replace('_', '-')}"
        ) from error
