"""What the tests of ROS 2 share."""

import pytest
from robots import Robot


@pytest.fixture
def router(monkeypatch):
    """A router of zenoh, to which every node of the test and of its programs connects: its port."""
    from routers import opened_router

    port, running = opened_router()
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'connect/endpoints=["tcp/127.0.0.1:{port}"]')
    yield port
    running.close()


@pytest.fixture
def robot(router):
    """What starts the robot, with the type of its action."""
    running = []

    def start(kind="GripperCommand"):
        running.append(Robot(kind))
        return running[0]

    yield start
    for robot in running:
        robot.end()
