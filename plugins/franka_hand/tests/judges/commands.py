"""pylibfranka, the maker's library, gives every command to an emulated hand: python commands.py HOST."""

import sys
import time

import pylibfranka

hand = pylibfranka.Gripper(sys.argv[1])
assert hand.server_version() == 3
assert hand.homing()
opened = hand.read_once()
assert abs(opened.max_width - 0.08) < 1e-9
assert opened.width > 0.078, opened.width
assert not opened.is_grasped

assert hand.move(0.065, 0.05)
assert abs(hand.read_once().width - 0.065) < 0.002
# The thing in the hand is 50 mm wide: a grasp at this width counts, one at another does not.
assert not hand.grasp(0.01, 0.05, 40.0, 0.005, 0.005)
assert not hand.read_once().is_grasped
assert hand.grasp(0.01, 0.05, 40.0, 0.005, 0.06)
held = hand.read_once()
assert held.is_grasped
assert 0.03 < held.width < 0.05, held.width
assert 0 < held.temperature < 100
assert hand.stop()
for width_m in (-0.01, 0.2):
    try:
        hand.move(width_m, 0.05)
    except pylibfranka.CommandException:
        continue
    raise AssertionError(f"a move to {width_m} m was not refused")
assert hand.move(0.08, 0.1)

times = []
for _ in range(45):
    hand.read_once()
    times.append(time.monotonic())
rate = (len(times) - 1) / (times[-1] - times[0])
assert 10.0 < rate < 16.0, rate
sys.stdout.write(
    f"pylibfranka {pylibfranka.__version__} drives the emulated hand; {rate:.1f} states a second\n"
)
