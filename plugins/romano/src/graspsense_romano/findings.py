"""The findings of the kind `touch`: what each case gave, and the trade of each threshold, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from statistics import NormalDist, mean
from typing import Final

import numpy as np

from graspsense.experiment_api import Findings, FoundTable, Summary, span, wilson
from graspsense_romano.touch import TouchRow

SLIPPED_M: Final = 1e-3
STILL_M: Final = 3e-4
"""A thing slipped if it came down by 1 mm in the fingers, and did not if it stayed within 0.3 mm."""
SLIP_THRESHOLDS_N: Final = (0.01, 0.02, 0.03, 0.048, 0.1, 0.15)
SHOCK_THRESHOLDS_M_S2: Final = (1.0, 2.0, 3.25, 5.0, 8.0)
SIDE_THRESHOLDS_N: Final = (0.05, 0.1, 0.2, 0.5, 1.0)
PUBLISHED: Final = {0.048: "published", 0.2: "published", 2.0: "published, gentle", 5.0: "published, fast"}
HELD: Final = ("steady", "running")


def findings(summary: Summary) -> Findings:
    """Return a row for each case, and the trades of the thresholds where the grasps show them."""
    cases: dict[str, list[TouchRow]] = {}
    for (case, _), result in summary.results.items():
        if isinstance(result, TouchRow):
            cases.setdefault(case, []).append(result)
    rows = [row for results in cases.values() for row in results]
    # Where weight and friction are swept, things slip in the lift, which is not scored.
    tables = [_cases(cases), *(tuple(_ranges(rows)) or _scores(rows))]
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


def _scores(rows: Sequence[TouchRow]) -> Iterator[FoundTable]:
    """Yield a table for each event that was measured, with and without it."""

    def known(key: str, chosen: Iterable[TouchRow]) -> list[float]:
        return [value for row in chosen if (value := getattr(row, key)) is not None]

    still, slipped = [r for r in rows if r.slip_m < STILL_M], [r for r in rows if r.slip_m > SLIPPED_M]
    bumped = {target: [r for r in rows if r.bump_at == target] for target in ("finger", "thing")}
    for key, low in (("slip_high_n", "0.18 N (published)"), ("slip_wide_n", "1 N (pipeline hold)")):
        title = f"Slip by more than 1 mm told from less than 0.3 mm by the high band, N; low band below {low}"
        yield from _trade(key, title, SLIP_THRESHOLDS_N, known(key, slipped), known(key, still))
    title, hits = "Placing told by the acceleration band, m/s2", known("shock_at_m_s2", rows)
    yield from _trade("place", title, SHOCK_THRESHOLDS_M_S2, hits, known("shock_before_m_s2", rows))
    title = "Bumps into a finger told from bumps into the thing by the high band of the edges, N"
    others = known("edge_before_n", rows) + known("edge_at_n", bumped["thing"])
    yield from _trade("side", title, SIDE_THRESHOLDS_N, known("edge_at_n", bumped["finger"]), others)
    title = "Bumps into finger or thing told by the acceleration band, m/s2: false alarms of placing"
    hits, others = known("bump_m_s2", rows), known("still_m_s2", rows)
    yield from _trade("bump", title, SHOCK_THRESHOLDS_M_S2, hits, others)


def _ranges(rows: Sequence[TouchRow]) -> Iterator[FoundTable]:
    """Yield for each law what became of things of each weight and friction, where there are several of both."""
    masses, frictions = (sorted({getattr(row, key) for row in rows}) for key in ("mass_kg", "friction"))
    if len(masses) < 2 or len(frictions) < 2:
        return
    note = (
        "Held: the greatest force, and how far it slipped. Lost: the greatest force; at the limit, if all of the force "
        "limit was asked for. In brackets the force that friction needs."
    )
    header = ("mass", *(f"friction {friction:g}" for friction in frictions))
    for law in dict.fromkeys(row.law for row in rows):
        fates = {(row.mass_kg, row.friction): _fate(row) for row in rows if row.law == law}
        table = [
            (f"{mass_kg:g} kg", *(fates.get((mass_kg, friction), "") for friction in frictions))
            for mass_kg in masses
        ]
        title = f"Weight and friction: {law}"
        yield FoundTable(id=f"range-{law}", title=title, header=header, rows=tuple(table), note=note)


def _fate(row: TouchRow) -> str:
    """Return in a few words what became of a thing."""
    needed = "" if row.needed_n is None else f" ({row.needed_n:.3g} N)"
    force = "?" if row.greatest_n is None else f"{row.greatest_n:.1f} N"
    if row.outcome in HELD:
        return f"held, {force}, {row.slip_m * 1e3:.1f} mm{needed}"
    return f"{row.outcome}, {force}{', at the limit' if row.limited else ''}{needed}"


def area(positive: Sequence[float], negative: Sequence[float]) -> tuple[float, float, float]:
    """Return the area under the ROC curve with its 95 % interval.

    The interval is that of R. G. Newcombe, Statistics in Medicine 25 (2006) 559, method 5.
    """
    higher, lower = np.array(positive)[:, None], np.array(negative)
    share = float((higher > lower).mean() + 0.5 * (higher == lower).mean())
    m, n = len(positive), len(negative)
    each, theta = 0.5 * (m + n) - 1.0, np.linspace(0.0, 1.0, 10_001)
    spread = 1.0 + each * (1.0 - theta) / (2.0 - theta) + each * theta / (1.0 + theta)
    error = np.sqrt(theta * (1.0 - theta) * spread / (m * n))
    inside = theta[np.abs(theta - share) <= NormalDist().inv_cdf(0.975) * error + 5e-5]
    return share, float(inside[0]), float(inside[-1])


def _trade(
    name: str, title: str, thresholds: Sequence[float], positive: Sequence[float], negative: Sequence[float]
) -> Iterator[FoundTable]:
    """Yield sensitivity and false alarms of each threshold, with the area under the ROC curve, if both are known."""
    if not (positive and negative):
        return
    table = []
    for threshold in thresholds:
        hits, alarms = (sum(value > threshold for value in values) for values in (positive, negative))
        table.append(
            (
                f"{threshold:g} ({PUBLISHED[threshold]})" if threshold in PUBLISHED else f"{threshold:g}",
                f"{hits} of {len(positive)} ({_interval(hits, len(positive))} %)",
                f"{alarms} of {len(negative)} ({_interval(alarms, len(negative))} %)",
            )
        )
    share, least, most = area(positive, negative)
    note = f"Area under the ROC curve: {share:.3f} ({least:.3f} to {most:.3f})."
    header = ("threshold", "told (sensitivity)", "false alarms")
    yield FoundTable(id=name, title=title, header=header, rows=tuple(table), note=note, numbers=1)
