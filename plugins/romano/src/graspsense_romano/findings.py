"""The findings of the kind `touch`: what each case gave, and the trade of each threshold, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import mean
from typing import Final

from graspsense.experiment_api import Findings, FoundTable, Summary, span, wilson
from graspsense_romano.touch import TouchRow

SLIPPED_M: Final = 1e-3
STILL_M: Final = 3e-4
"""A thing slipped if it came down by 1 mm in the fingers, and did not if it stayed within 0.3 mm."""
SLIP_THRESHOLDS_N: Final = (0.01, 0.02, 0.03, 0.048, 0.1, 0.2)
SHOCK_THRESHOLDS_M_S2: Final = (1.0, 2.0, 3.25, 5.0, 8.0)
PUBLISHED: Final = {0.048: "0.048 (published)", 2.0: "2 (published, gentle)", 5.0: "5 (published, fast)"}
HELD: Final = ("steady", "running")


def findings(summary: Summary) -> Findings:
    """Return a row for each case, and the trades of the thresholds where the grasps show them."""
    cases: dict[str, list[TouchRow]] = {}
    for (case, _), result in summary.results.items():
        if isinstance(result, TouchRow):
            cases.setdefault(case, []).append(result)
    rows = [row for found in cases.values() for row in found]
    tables = [_cases(cases)]
    still = [r.slip_high_n for r in rows if r.slip_high_n is not None and r.slip_m < STILL_M]
    slipped = [r.slip_high_n for r in rows if r.slip_high_n is not None and r.slip_m > SLIPPED_M]
    if still and slipped:
        note = f"{len(slipped)} grasps slipped by more than 1 mm, {len(still)} by less than 0.3 mm."
        tables.append(
            _trade(
                "slip", "Slip told by the high band of the pads, N", note, SLIP_THRESHOLDS_N, slipped, still
            )
        )
    before = [r.shock_before_m_s2 for r in rows if r.shock_before_m_s2 is not None]
    at = [r.shock_at_m_s2 for r in rows if r.shock_at_m_s2 is not None]
    if before and at:
        note = f"{len(at)} grasps at the table, {len(before)} on the way to it."
        title = "Placing told by the acceleration band, m/s2"
        tables.append(_trade("place", title, note, SHOCK_THRESHOLDS_M_S2, at, before))
    kept = sum(row.outcome in HELD for row in rows)
    answer = (
        f"Simulated by MuJoCo: {kept} of {len(rows)} grasps ended as planned, {sum(r.broken for r in rows)} things "
        f"broke."
    )
    return Findings(answer=answer, tables=tuple(tables))


def _cases(cases: dict[str, list[TouchRow]]) -> FoundTable:
    columns: Sequence[tuple[str, Callable[[TouchRow], float | None], float]] = (
        ("contact N", lambda r: r.contact_n, 1.0),
        ("grip N", lambda r: r.grip_n, 1.0),
        ("greatest N", lambda r: r.greatest_n, 1.0),
        ("deformed mm", lambda r: r.deformed_m, 1e3),
        ("lifted mm", lambda r: r.lifted_m, 1e3),
        ("slip mm", lambda r: r.slip_m, 1e3),
        ("placed after s", lambda r: r.placed_s, 1.0),
    )
    table = []
    for name, rows in cases.items():
        kept = sum(row.outcome in HELD for row in rows)
        cells = [
            f"{kept} of {len(rows)} ({_interval(kept, len(rows))} %)",
            str(sum(row.broken for row in rows)),
        ]
        cells += [_spread([f(row) for row in rows], factor) for _, f, factor in columns]
        table.append((name, *cells))
    return FoundTable(
        id="cases",
        title="What each case gave",
        header=("case", "ended as planned", "broken", *(name for name, _, _ in columns)),
        rows=tuple(table),
        note="Means over the grasps, with the least and the greatest. Ended as planned: held to the end, or let go "
        "when put down. Intervals are at 95 % (Wilson).",
        numbers=1,
    )


def _spread(values: Sequence[float | None], factor: float) -> str:
    known = [value * factor for value in values if value is not None]
    if not known:
        return ""
    if len(known) == 1:
        return f"{known[0]:.2f}"
    return f"{mean(known):.2f} ({min(known):.2f} to {max(known):.2f})"


def _interval(hits: int, n: int) -> str:
    return span(wilson(hits, n))


def _trade(
    name: str,
    title: str,
    note: str,
    thresholds: Sequence[float],
    positive: Sequence[float],
    negative: Sequence[float],
) -> FoundTable:
    """Return sensitivity and false alarms of each threshold."""
    table = []
    for threshold in thresholds:
        hits, alarms = (sum(value > threshold for value in values) for values in (positive, negative))
        table.append(
            (
                PUBLISHED.get(threshold, f"{threshold:g}"),
                f"{hits} of {len(positive)} ({_interval(hits, len(positive))} %)",
                f"{alarms} of {len(negative)} ({_interval(alarms, len(negative))} %)",
            )
        )
    header = ("threshold", "told (sensitivity)", "false alarms")
    return FoundTable(id=name, title=title, header=header, rows=tuple(table), note=note, numbers=1)
