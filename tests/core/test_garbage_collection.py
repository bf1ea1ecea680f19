"""Garbage collection is suspended where its pauses do harm, and afterwards as it was before."""

import gc
import threading

import pytest

from graspsense.core.control.garbage_collection import no_collection, present_objects_kept


@pytest.mark.parametrize("collects", [True, False])
def test_of_contexts_that_overlap_in_threads_the_last_restores_what_was_before(collects):
    def enter(inside, leave):
        with no_collection():
            inside.set()
            leave.wait(60.0)

    was_enabled = gc.isenabled()
    (gc.enable if collects else gc.disable)()
    try:
        inside, leave = threading.Event(), threading.Event()
        other = threading.Thread(target=enter, args=(inside, leave))
        with no_collection():
            other.start()
            assert inside.wait(60.0)
            assert not gc.isenabled()
        assert not gc.isenabled()
        leave.set()
        other.join()
        assert gc.isenabled() == collects
    finally:
        (gc.enable if was_enabled else gc.disable)()


@pytest.mark.slow
def test_what_is_there_is_not_collected_and_what_comes_is():
    gone: list[str] = []

    class Cyclic:
        def __init__(self, name):
            self.itself, self.name = self, name

        def __del__(self):
            gone.append(self.name)

    with no_collection():  # none but those asked for
        Cyclic("before")
        with present_objects_kept():
            Cyclic("within")
            gc.collect(0)
            assert gone == ["within"]
        gc.collect()
        assert gone == ["within", "before"]
