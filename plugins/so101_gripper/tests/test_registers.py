"""Registers, packets and geometry of the gripper's motor."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_so101_gripper.emulator.motor import EmulatedMotor
from graspsense_so101_gripper.emulator.protocol import PING, READ, SYNC_READ, SYNC_WRITE, Requests, packet
from graspsense_so101_gripper.jaw import Jaw
from graspsense_so101_gripper.registers import REGISTERS, STATE, MotorRequest, motor_state


def test_the_sign_of_the_load_is_bit_10():
    """1042 is what users read while it opens: 18 of 1000 in the other direction."""
    load = REGISTERS["present_load"]
    assert load.number((1042).to_bytes(2, "little"), start=load.address) == -18
    assert load.written(-18) == (1042).to_bytes(2, "little")


def test_the_gap_is_the_chord_of_the_jaw():
    assert Jaw(0, 2048, 0.1).gap_m(1024) == pytest.approx(0.1 * 2**0.5)


@given(st.data())
def test_what_is_written_is_read(data):
    name = data.draw(st.sampled_from(sorted(REGISTERS)))
    register = REGISTERS[name]
    most = (1 << (8 * register.size if register.sign_bit is None else register.sign_bit)) - 1
    number = data.draw(st.integers(0 if register.sign_bit is None else -most, most))
    assert register.number(register.written(number), start=register.address) == number


def test_what_is_asked_is_one_write_of_neighbours():
    asked = MotorRequest(1, 50, 2000, 0, 300, 420)
    motor = EmulatedMotor(6, 777)
    motor.write(STATE[0], asked.written())
    assert motor_state(motor.read(*STATE)).asked == asked
    places = [REGISTERS[name] for name in MotorRequest._fields]
    assert [a.address + a.size for a in places[:-1]] == [b.address for b in places[1:]]


@given(st.integers(1, 1400), st.booleans(), st.integers(0, 1400), st.floats(0.03, 0.2))
def test_the_gap_of_a_position_gives_the_position(stroke, inverted, position, length_m):
    position = min(position, stroke)
    jaw = Jaw(2000, 2000 - stroke, length_m) if inverted else Jaw(1000, 1000 + stroke, length_m)
    steps = jaw.closed + jaw.opens * position
    assert jaw.position(jaw.gap_m(steps)) == steps
    assert jaw.gap_m(jaw.closed - 5 * jaw.opens) == 0.0
    assert jaw.position(1.0) == jaw.opened or stroke > 1023
    if position:
        # The rate is the slope of the gap, which is monotonic.
        slope = (jaw.gap_m(steps) - jaw.gap_m(steps - jaw.opens)) * jaw.opens
        assert jaw.gap_rate(steps, 1.0) == pytest.approx(slope, rel=0.02, abs=2e-6)
        assert jaw.speed(jaw.gap_m(steps), abs(jaw.gap_rate(steps, 100.0))) == pytest.approx(100.0)


@given(st.binary(max_size=200), st.integers(1, 30))
def test_any_bytes_in_any_pieces_are_taken(data, size):
    whole, pieces = (Requests({motor: EmulatedMotor(motor, 777) for motor in (1, 6)}) for _ in range(2))
    assert b"".join(pieces.fed(data[i : i + size]) for i in range(0, len(data), size)) == whole.fed(data)


def test_requests_of_the_manual():
    """The manual's ping of motor 1, and its reply: FF FF 01 02 01 FB, FF FF 01 02 00 FC."""
    motors = {motor: EmulatedMotor(motor, 777) for motor in (1, 6)}
    bus = Requests(motors)
    assert packet(1, PING) == bytes.fromhex("ff ff 01 02 01 fb")
    assert bus.fed(packet(1, PING)) == bytes.fromhex("ff ff 01 02 00 fc")
    assert bus.fed(packet(0xFE, PING)) == packet(1, 0) + packet(6, 0)
    assert bus.fed(packet(6, READ, bytes((3, 2)))) == packet(6, 0, bytes((9, 3)))
    damaged = bytearray(packet(6, READ, bytes((3, 2))))
    damaged[-1] ^= 1
    assert bus.fed(bytes(damaged)) == b""
    ids = packet(6, 0, b"\6") + packet(1, 0, b"\1")
    assert bus.fed(packet(0xFE, SYNC_READ, bytes((5, 1, 6, 1, 9)))) == ids
    assert bus.fed(packet(0xFE, SYNC_WRITE, bytes((40, 1, 1, 1, 6, 0)))) == b""
    assert [motors[1].number("torque_enable"), motors[1].writes, motors[6].writes] == [1, 1, 1]
