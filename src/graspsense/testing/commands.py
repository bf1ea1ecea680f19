"""Checks of what a gripper does on a command: how it moves, within which limits, and which kinds it accepts."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, isnan
from typing import Final

from graspsense.core.components.entries import KINDS
from graspsense.core.values.signals import (
    EFFORT,
    FORCE,
    POSITION,
    VELOCITY,
    Command,
    Reading,
)
from graspsense.testing.checks import CheckSkipped, demand
from graspsense.testing.laws import kind_of
from graspsense.testing.session import limits_of, opened, readings_of, use
from graspsense.testing.subject import Subject

MOVED_M: Final = 1e-3
"""The change of the gap (m) by which a gripper is seen to obey a command."""


def opening_and_relaxing_are_accepted(subject: Subject) -> None:
    """The opening and the relaxing command are of kinds that it accepts."""
    info = subject.session.info
    for name, command in (("opening", info.opening), ("relaxed", info.relaxed)):
        if command is not None:
            kind = KINDS[command.kind]
            demand(
                kind in subject.entry.accepts,
                f"its {name} command is of kind {kind}; it accepts {', '.join(subject.entry.accepts) or 'none'}: use "
                "one of those, or add it to `accepts`",
            )


def velocity_is_the_rate_of_the_gap(subject: Subject) -> None:
    """The sum of `velocity_m_s` over time is the change of the gap; closing is negative."""
    frames = [reading.frame for reading in subject.session.stages.get("closing", [])]
    if not frames or isnan(frames[0].velocity_m_s) or isnan(frames[0].gap_m):
        raise CheckSkipped("this gripper has no velocity and gap of its own, or is a recording")
    moved = frames[-1].gap_m - frames[0].gap_m
    summed = sum(frame.velocity_m_s * frame.dt_s for frame in frames[1:])
    if max(abs(moved), abs(summed)) < 2e-3:
        raise CheckSkipped(f"the gap moved by {abs(moved) * 1e3:.2g} mm only")
    demand(
        abs(summed - moved) <= 0.3 * abs(moved),
        f"velocity_m_s adds up to {summed * 1e3:.3g} mm where the gap moved by {moved * 1e3:.3g} mm: give the rate of "
        "the gap in m/s, negative while it closes (both fingers together)",
    )


def closing_closes(subject: Subject) -> None:
    """A gentle closing command of each kind in `accepts` reduces the gap; the opening command increases it again."""
    stages = subject.session.stages
    if "closing" not in stages:
        raise CheckSkipped("a recording cannot be commanded")
    for name in subject.entry.accepts:
        kind = KINDS.index(name)
        usual = kind == kind_of(subject.entry.accepts)
        gaps = _gaps_of((stages if usual else readings_of(subject, kind).stages)["closing"])
        if all(map(isnan, gaps)):
            raise CheckSkipped("this gripper has no gap")
        demand(
            gaps[0] - gaps[-1] > MOVED_M,
            f"under a closing {name} command the gap goes from {gaps[0]:.4g} to {gaps[-1]:.4g} m: an effort or force "
            "above 0, a velocity below 0 and a smaller position close the fingers; a kind that the gripper does not "
            "obey is not in `accepts`",
        )
    opened = _gaps_of(stages["open again"])
    demand(
        max(opened) - opened[0] > MOVED_M,
        f"under the opening command {subject.session.info.opening} the gap goes from {opened[0] * 1e3:.4g} to "
        f"{opened[-1] * 1e3:.4g} mm: it must rise",
    )


def _gaps_of(readings: Iterable[Reading]) -> list[float]:
    return [reading.frame.gap_m for reading in readings]


def stays_within_its_limits(subject: Subject) -> None:
    """Under the largest commands of each kind in `accepts`, frames come, with an effort and a speed within limits."""
    demand(bool(subject.entry.accepts), "`accepts` is empty: a gripper takes at least one kind of command")
    if subject.session.info.opening is None:
        raise CheckSkipped("a recording cannot be commanded")
    for name in subject.entry.accepts:
        kind = KINDS.index(name)
        # Fingers that other work on the computer holds up catch up faster, but hardly in a second session.
        beyond = _beyond_limits(subject, kind) and _beyond_limits(subject, kind)
        demand(not beyond, beyond)


def _beyond_limits(subject: Subject, kind: int) -> str:
    """Return in words what exceeds its limit under the largest commands of this kind; empty if nothing does."""
    with opened(subject) as (backend, session):
        usual = limits_of(session.info)
        # The limits of a first use apply after a contact too.
        limits = usual._replace(effort_limit_n=usual.first_effort_n, speed_limit_m_s=usual.first_speed_m_s)
        greatest = {VELOCITY: -1e6, POSITION: 0.0, FORCE: 1e6, EFFORT: 1e6}[kind]
        ticks = max(int(0.5 * session.info.rate_hz), 20)
        use(session, backend, "closing hard", ticks, Command(kind, greatest, inf, inf), limits)
    demand(len(session.frames) > 1, f"after a {KINDS[kind]} command no frame came")
    for name, limit, least, grace in (
        ("effort_n", usual.first_effort_n, backend.least_force_n, 1.1),
        ("velocity_m_s", usual.first_speed_m_s, backend.least_speed_m_s, 3.0),
    ):
        for value in (getattr(frame, name) for frame in session.frames):
            if abs(value) > grace * max(limit, least):
                return (
                    f"{name} reaches {abs(value):.3g} under {KINDS[kind]} commands limited to {limit:g}: apply "
                    "`effort_limit_n` and `speed_limit_m_s` of each command"
                )
    return ""


def says_what_commands_become(subject: Subject) -> None:
    """A gripper that closes by itself says for each kind of command what it becomes, and accepts no effort."""
    backend = subject.create()
    if not backend.closes_itself:
        return
    demand(
        "effort" not in subject.entry.accepts,
        "it closes by itself and accepts an effort, which has no speed, so that it would rush: take 'effort' out of "
        "`accepts`",
    )
    lacking = [kind for kind in subject.entry.accepts if not backend.closes_itself.get(kind)]
    demand(
        not lacking,
        f"`closes_itself` does not say what a command of {', '.join(lacking)} becomes: write it in a few words",
    )
