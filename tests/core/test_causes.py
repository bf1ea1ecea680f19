"""Of the faults of a grasp, the cause is told: the rule over the table of what follows from what."""

from itertools import chain

from cases import every_case

from graspsense.core.grasp.protection.causes import GRASP, PAD, causes, following, follows

NAMES = {
    name
    for known in (*GRASP, *(f"{side} {what}" for side in ("left", "right") for what in PAD))
    for name in (known, *following(known))
}


@every_case(
    ("seen", "told"),
    [
        # A fingertip that is stuck in the squeeze, under each controller.
        (
            "left fingertip stuck, left fingertip with frozen cells, left pad stands still, left pad stuck, "
            "pads disagree, left pad feels more on opening, left pad off its zero",
            "left fingertip stuck",
        ),
        (
            "left pad stands still, right pad stands still, pads disagree",
            "left pad stands still, right pad stands still",
        ),
        # The zero of one pad has moved; noise has moved nothing.
        ("left pad jumps, left pad feels more on opening, left pad off its zero", "left pad off its zero"),
        (
            "right pad noisy, right pad off its zero, left pad off its zero",
            "right pad noisy, left pad off its zero",
        ),
        # A fingertip of which its gripper knows.
        ("left pad dead, left fingertip without signal, right finger alone", "left pad dead"),
        ("left pad absent, left finger alone", "left pad absent, left finger alone"),
        ("clock jumps, cell images stopped, stalled, gap late", "clock jumps"),
        ("motor too weak, motor reversed, gap jumps", "motor reversed, gap jumps"),
    ],
)
def test_what_follows_from_a_fault_is_not_told_beside_it(seen, told):
    assert causes(seen.split(", ")) == told.split(", ")


def test_each_fault_stands_alone_and_no_two_follow_from_each_other():
    for name in NAMES:
        assert causes([name]) == [name]
        assert not [other for other in NAMES if follows(name, other) and follows(other, name)]


def test_what_follows_from_a_fault_of_one_pad_is_never_a_fault_of_the_other():
    """But for the finger of the other pad, which feels what this one does not."""
    left = set(chain.from_iterable(following(f"left {what}") for what in PAD))
    assert {name for name in left if name.startswith("right")} == {"right finger alone"}
    assert "left finger alone" not in left


def test_every_name_of_the_rule_is_that_of_a_check():
    """A fault that is renamed would otherwise be told beside its cause."""
    from pathlib import Path

    import graspsense.core.grasp.protection as protection

    source = "".join(
        path.read_text() for path in Path(protection.__file__).parent.glob("*.py") if path.name != "causes.py"
    )
    for name in NAMES:
        side, _, what = name.partition(" ")
        assert (what if side in ("left", "right") else name) in source, name
