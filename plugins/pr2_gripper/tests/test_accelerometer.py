"""The accelerometer of the palm: from the words of a report to a recording, and what is lost on the way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases import every_case

from graspsense.plugin_api import Samples
from graspsense_pr2_gripper import emulation
from graspsense_pr2_gripper.accelerometer import CHANNEL, Accelerometer, word_of
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.link import LockStepLink
from graspsense_pr2_gripper.protocol import (
    SAMPLES_MISSED,
    InputReport,
    decode_input,
    encode_input,
)
from graspsense_pr2_gripper.stream import Stream


def report(sequence, words, status=0):
    return encode_input(
        InputReport(sequence, 1000 * sequence, 0, 0, 0, status, 0, words, 0, 0, (0, 0, 0, 0), 1, 0)
    )


def test_a_word_holds_three_signed_axes_and_is_limited_to_the_full_scale():
    def back(sample):
        read: Samples = Accelerometer(8).signals(0.0, (word_of(sample, 8),), 1).acceleration
        return read.values[0]

    step = 8 * 9.81 / 512
    assert back((0.0, -9.81, 9.81)) == (0.0, -64 * step, 64 * step)
    assert back((0.4 * step, 1.6 * step, -0.6 * step)) == (0.0, 2 * step, -step)
    assert back((1e3, -1e3, 0.0)) == (511 * step, -512 * step, 0.0)


def test_a_tick_has_the_declared_shape_and_nan_behind_what_is_new():
    for words in ((), (1,), (1, 2, 3), (1, 2, 3, 4)):
        block: Samples = Accelerometer(2).signals(1.5, words, 10).acceleration
        assert (block.t_s, block.counter, block.new) == (1.5, 10, len(words))
        assert [len(row) for row in block.values] == [3] * CHANNEL.samples
        assert all(math.isnan(number) for row in block.values[block.new :] for number in row)


def test_lost_reports_and_samples_that_the_board_missed_are_counted():
    stream = Stream()
    stream.take(report(7, (1, 2, 3)))
    stream.take(report(10, (4, 5, 6)))
    assert stream.sampled == 12, "two reports of three samples are lost"
    stream.take(report(11, (7, 8, 9, 10), SAMPLES_MISSED))
    assert stream.sampled == 17, "at least one more than the report holds"


@every_case(
    ("sequence", "later", "words", "sampled"),
    [(2, (3, 4), (1, 2, 3, 4), 4), (3, (5, 6), (5, 6), 6)],
)
def test_samples_of_a_report_that_was_skipped_come_with_the_next_one_but_not_over_a_gap(
    fed, sequence, later, words, sampled
):
    link = LockStepLink(fed(report(1, (1, 2)), report(sequence, later)), 1e-3)
    arrival = link.next(1e-3)
    assert arrival is not None
    assert (arrival.words, arrival.sampled) == (words, sampled)


@pytest.fixture
def opened_and_read(near):
    """Opens an emulated gripper with these settings: what it says, and half a second of its readings."""

    def read(faults=None, **settings):
        backend = near(faults, calibration="none", **settings)
        info = backend.open(1)
        readings = [backend.read(0.1) for _ in range(500)]
        backend.close()
        return info, [reading for reading in readings if reading is not None]

    return read


@pytest.mark.slow
def test_every_sample_that_the_board_sends_arrives(monkeypatch, opened_and_read):
    words = []

    class Sent(Wire):
        """A wire that keeps the samples that the board sent."""

        def step(self):
            arriving = super().step()
            words.extend(word for data in arriving for word in decode_input(data).samples)
            return arriving

    monkeypatch.setattr(emulation, "Wire", Sent)
    _, readings = opened_and_read()
    counts = np.array([[word >> shift & 1023 for shift in (0, 10, 20)] for word in words])
    sent = np.where(counts < 512, counts, counts - 1024) * (8 * 9.81 / 512)
    blocks = [reading.signals.acceleration for reading in readings]
    arrived = np.concatenate([block.values[: block.new] for block in blocks])
    assert len(arrived) == 3 * len(readings)
    # The first reports are read while the gripper is opened.
    assert arrived.tolist() in (sent[k : k + len(arrived)].tolist() for k in range(len(sent)))


@every_case(("drop", "least", "most"), [(0.0, 0.0, 0.0), (0.05, 0.02, 0.1)])
def test_reports_that_are_dropped_show_as_lost_samples(opened_and_read, drop, least, most):
    _, readings = opened_and_read({"drop": drop})
    samples = [reading.signals.acceleration for reading in readings]
    arrived = sum(block.new for block in samples)
    counted = samples[-1].counter - samples[0].counter + samples[0].new
    assert least <= (counted - arrived) / counted <= most
    assert {block.new for block in samples} == {3}
    assert (np.diff([block.t_s for block in samples]) > 0.0).all()


def test_a_board_without_an_accelerometer_reads_as_before_and_says_so(opened_and_read):
    _, with_it = opened_and_read()
    info, without = opened_and_read({"identity": {"accelerometer_g": 0}})
    assert "no accelerometer" in " ".join(info.notes)
    assert {reading.signals.acceleration.new for reading in without} == {0}
    assert repr([reading.frame for reading in without]) == repr([reading.frame for reading in with_it])


def test_the_channel_can_be_left_out_by_the_settings(near, opened_and_read):
    assert CHANNEL not in near(accelerometer=False).channels
    _, readings = opened_and_read(accelerometer=False)
    assert {reading.signals for reading in readings} == {()}
