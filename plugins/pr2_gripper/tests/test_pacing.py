"""The board's periods on a clock of the test's own."""

from itertools import islice
from types import SimpleNamespace

import pytest

from graspsense_pr2_gripper.transports import emulated


def test_what_is_late_is_made_up_for_so_that_the_devices_clock_stays_with_the_hosts(
    monkeypatch,
):
    now = [5.0]
    slept = []

    def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds

    monkeypatch.setattr(emulated, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
    began = []
    late = []
    for late_s in islice(emulated.on_time(0.001), 400):
        began.append(now[0])
        late.append(late_s)
        # The hundredth period takes 50 ms, all others a tenth of what they may.
        now[0] += 0.05 if len(began) == 100 else 0.0001
    assert began[:3] == pytest.approx([5.0, 5.001, 5.002])
    assert late[99] == pytest.approx(0.0, abs=1e-9)
    assert late[100] == pytest.approx(0.049)
    assert began[399] == pytest.approx(5.399)
    assert late[399] == pytest.approx(0.0, abs=1e-9)
    assert min(slept) > 0.0
