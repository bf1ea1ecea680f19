"""Reports as they come: what is lost, late, repeated or damaged is counted, and images come together all the same."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_pr2_gripper.protocol import InputReport, encode_input
from graspsense_pr2_gripper.stream import RESTARTED, Restarted, Stream

IMAGE = tuple(range(3000, 3044))


def report(sequence, *, image=1, slice=0, cells=None, age_us=0):
    part = cells if cells is not None else IMAGE[4 * slice : 4 * slice + 4]
    return encode_input(
        InputReport(sequence & 0xFFFFFFFF, 1000 * sequence, 0, 0, 0, 0, 0, (), image, slice, part, 1, age_us)
    )


def reports(start, count, image=1):
    """A board's stream: the image's slices over and over."""
    return [report(start + i, image=image, slice=i % 11, age_us=1000 * i) for i in range(count)]


def taken(sent):
    """Return a stream that has taken these reports, and for each whether it was handed on."""
    stream = Stream()
    return stream, [stream.take(data) is not None for data in sent]


def test_image_is_whole_after_eleven_reports_and_bears_the_time_it_was_taken():
    assert taken(reports(100, 10))[0].image is None
    assert taken(reports(100, 11))[0].image == (1, 100_000, IMAGE)


def test_lost_report_delays_an_image_by_one_round_and_no_more():
    stream = Stream()
    sent = reports(0, 41)
    del sent[4]
    whole_after = next(i for i, data in enumerate(sent, 1) if stream.take(data) and stream.image)
    assert whole_after == 15  # slice 4 comes again as report 15
    assert stream.counts.lost == 1
    assert stream.image == (1, 0, IMAGE)


def test_image_that_never_came_whole_is_counted_and_not_made_up():
    stream, _ = taken([*reports(0, 41, image=1), *reports(41, 5, image=2), *reports(46, 41, image=4)])
    assert stream.image.counter == 4, "lost images are counted"
    # Number 2 was cut short, number 3 never came.
    assert (stream.counts.images, stream.counts.images_lost) == (2, 2)


def test_counters_wrap():
    start = 2**32 - 20
    sent = [report(start + i, image=65535, slice=i % 11) for i in range(20)]
    stream, handed_on = taken([*sent, *reports(0, 11)])
    assert all(handed_on)
    assert (stream.counts.lost, stream.counts.images, stream.counts.images_lost) == (0, 2, 0)


def test_late_report_is_not_handed_on_but_its_cells_count():
    sent = reports(0, 11)
    sent[4], sent[5] = sent[5], sent[4]
    stream, handed_on = taken(sent)
    assert handed_on == [True] * 5 + [False] + [True] * 5
    assert (stream.counts.lost, stream.counts.out_of_order) == (0, 1)
    assert stream.image is not None


def test_device_that_begins_anew_is_noticed():
    stream, handed_on = taken([report(5000), *(report(i) for i in range(RESTARTED - 1))])
    assert not any(handed_on[1:])
    with pytest.raises(Restarted, match="5000 to 31"):
        stream.take(report(RESTARTED - 1))


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.sampled_from(["pass", "drop", "repeat", "swap", "damage"]), min_size=1, max_size=80),
    st.randoms(use_true_random=False),
)
def test_what_is_counted_adds_up(start, fates, chance):
    """The first and last report pass, so that both ends are known; then every report is accounted for."""
    stream = Stream()
    arriving = [report(start)]
    held = []
    expected = {"drop": 0, "repeat": 0, "swap": 0, "damage": 0}
    for i, fate in enumerate(fates, 1):
        data = report(start + i)
        if fate == "swap" and not held:
            held.append(data)
            expected["swap"] += 1
            continue
        if fate == "drop":
            expected["drop"] += 1
            continue
        if fate == "damage":
            broken = bytearray(data)
            broken[chance.randrange(64)] ^= 1 << chance.randrange(8)
            data = bytes(broken)
            expected["damage"] += 1
        elif fate == "repeat":
            arriving.append(data)
            expected["repeat"] += 1
        arriving.append(data)
        if fate == "pass" and held:
            arriving.append(held.pop())
    arriving += [report(start + len(fates) + 1), *held]
    handed_on = [stream.take(data) for data in arriving]
    counts = stream.counts
    sequences = [(passed.sequence - start) & 0xFFFFFFFF for passed in handed_on if passed]
    assert sequences == sorted(set(sequences))
    counted = {"damage": counts.corrupt, "repeat": counts.repeated, "swap": counts.out_of_order}
    assert expected == counted | {"drop": counts.lost - counts.corrupt}
    assert counts.reports + counts.out_of_order + counts.lost == len(fates) + 2
