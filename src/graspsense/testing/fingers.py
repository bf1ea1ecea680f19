"""The check of a hand: the two forces of its frames are what the declared fingers bear."""

from __future__ import annotations

from math import isclose

from graspsense.core.values.fingers import fingers_of, opposed_forces
from graspsense.testing.checks import CheckFailed, demand
from graspsense.testing.subject import Subject


def fingers_are_those_declared(subject: Subject) -> None:
    """The two forces of each frame follow from the forces of the declared fingers by the declared rule."""
    fingers = fingers_of(subject.entry.channels)
    if not fingers:
        return
    try:
        forces_of = opposed_forces(fingers)
    except ValueError as error:
        raise CheckFailed(f"its fingers: {error}") from error
    for reading in subject.session.readings:
        each = [getattr(reading.signals, finger.name) for finger in fingers]
        frame = reading.frame
        for side, given, follows in zip(
            ("left", "right"), (frame.force_left_n, frame.force_right_n), forces_of(each), strict=True
        ):
            same = isclose(given, follows, rel_tol=1e-9, abs_tol=1e-9) or (
                given != given and follows != follows
            )
            demand(
                same,
                f"force_{side}_n is {given:g} where the fingers bear {', '.join(f'{force:g}' for force in each)} N, "
                f"which are {follows:g} N by touch={fingers[0].touch!r}: fill the frame with "
                "opposed_forces(self.channels)(forces)",
            )
