"""A thread that reads a device: the newest value, its age, what was replaced, and the error that ended it."""

import queue
import threading

import pytest

from graspsense.gripper_api import ReadingThread
from graspsense.plugin_api import DeviceLost


class Wire:
    """Gives what the test puts in; `taken` counts what the thread has asked for."""

    def __init__(self):
        self.values = queue.Queue()
        self.idle = threading.Semaphore(0)

    def read(self):
        if self.values.empty():
            self.idle.release()
        try:
            value = self.values.get(timeout=0.01)
        except queue.Empty:
            return None
        if isinstance(value, BaseException):
            raise value
        return value

    def give(self, *values):
        """Give these values, and wait until the thread has taken them all and come back for more."""
        for value in values:
            self.values.put(value)
        while not self.values.empty():
            self.idle.acquire()
        while self.idle.acquire(blocking=False):
            pass
        self.idle.acquire()
        self.idle.acquire()


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def reading(wire):
    threads = []

    def reading(**options):
        threads.append(ReadingThread(wire.read, **options))
        return threads[-1]

    yield reading
    for thread in threads:
        assert thread.close(60.0)


def test_the_newest_value_is_given_once_and_the_replaced_are_counted(wire, reading):
    thread = reading()
    assert thread.age_s() == float("inf")
    wire.give(*range(5))
    assert (thread.newest(60.0), thread.replaced) == (4, 4)
    assert 0.0 <= thread.age_s() < 60.0
    assert thread.newest(0.0) is None


def test_values_that_nobody_asked_for_are_joined(wire, reading):
    thread = reading(joined=lambda earlier, now: earlier + now)
    wire.give([1], [2], [3])
    assert thread.newest(60.0) == [1, 2, 3]


def test_an_error_comes_after_the_values_before_it_and_stays(wire, reading):
    thread = reading()
    wire.give(7)
    wire.values.put(DeviceLost("unplugged"))
    assert thread.newest(60.0) == 7
    for _ in range(2):
        with pytest.raises(DeviceLost, match="unplugged"):
            thread.newest(60.0)


def test_closing_is_bounded_where_a_read_hangs():
    freed = threading.Event()
    thread = ReadingThread(freed.wait)
    assert not thread.close(0.05)
    freed.set()
    assert thread.close(60.0)
    assert thread.close(60.0), "twice"
