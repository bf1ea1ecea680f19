"""Drivers that others wrote drive the emulated gripper at this port.

    python grippers.py PORT

It runs in an environment without graspsense. What each driver reads has to be what it asked for, within a step of the
position or the reach of the thing between the fingers.
"""

import sys
import time

import pyrobotiqgripper
import robotiq2f

DEADLINE_S = 30.0


def by_pyrobotiqgripper(port: str) -> None:
    gripper = pyrobotiqgripper.RobotiqGripper(com_port=port, connection_type="RTU")
    gripper.timeOut = DEADLINE_S
    gripper.activate()
    gripper.start()
    gripper.open()
    assert gripper.position() <= 4, gripper.position()
    gripper.move(255, speed=255, force=0)
    gripper.readStatus()
    status = gripper.status()
    gripper.open()
    opened = gripper.position()
    gripper.disconnect()
    assert status["gOBJ"] == 2, status
    assert status["gPR"] == 255, status
    assert 30 < status["gPO"] < 200, status
    # 20 N at 1.5 N a step.
    assert 11 <= status["gCU"] <= 14, status
    assert opened <= 4, opened


def by_robotiq2f(port: str) -> None:
    # Its search asks udev for a serial number, which a pseudo-terminal does not have.
    robotiq2f.LinuxFindTTYWithSerialNumber.find = lambda self, serial_number: port
    robotiq2f.robotiq2f.LinuxFindTTYWithSerialNumber.find = lambda self, serial_number: port
    with robotiq2f.Robotiq2F85(serial_number="any", async_control=False) as gripper:
        # It waits 50 ms for a reply, which a busy machine can exceed.
        gripper.client.serial.timeout = DEADLINE_S
        gripper.reset()
        assert gripper.is_activated
        for opening_mm, found_mm, holds in ((85.0, 85.0, False), (75.0, 75.0, False), (0.0, None, True)):
            gripper.go_to(opening=opening_mm, speed=150.0, force=20.0)
            # It answers from what it read last for as long as 5 ms.
            time.sleep(0.05)
            until = time.monotonic() + DEADLINE_S
            while gripper.is_moving and time.monotonic() < until:
                pass
            status = gripper.read_status()
            assert status.obj_detected == holds, status
            # It takes a step for 0.39 mm, and the manual's stroke gives 0.374 mm.
            if found_mm is not None:
                assert abs(status.opening - found_mm) < 2.0, status
            else:
                assert 20.0 < status.opening < 75.0, status
        gripper.go_to(opening=85.0, speed=150.0, force=20.0)


by_pyrobotiqgripper(sys.argv[1])
by_robotiq2f(sys.argv[1])
print("judges: pyRobotiqGripper and robotiq2f drive the emulated gripper")  # noqa: T201
