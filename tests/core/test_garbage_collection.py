"""Garbage collection is suspended where its pauses do harm, and afterwards as it was before."""

import gc
import threading

import pytest

from graspsense.core.control.garbage_collection import no_collection


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
