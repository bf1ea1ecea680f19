"""How much each term of the object did in a grasp: its law run once more along the compressions of that grasp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from graspsense_sim_gripper.plant import PlantParams
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import WorkingPoint


def explain(
    kinds: Sequence[str],
    terms: Sequence[Any],
    plant: PlantParams,
    path_m: Sequence[float],
    forces_n: Sequence[float],
    dt_s: float,
) -> dict[str, Any]:
    """Return the size of every term, as plain values, whether it was kept in this grasp's model or not.

    `path_m` holds the compression of the object at each tick from the first contact on, `forces_n` the force that
    went with it. A term has its greatest force (`peak_n`), its force and its share of the whole where the whole
    is greatest (`at_peak_n`, `share`), the work done on it until then (`work_j`), what it had not given back at
    the end (`lost_j`), what its law alone expects of such a grasp (`expected_n`), and its `rates`.
    """
    if not path_m:
        return {"touched": False, "terms": []}
    path = [0.0, *path_m]
    top = max(range(len(forces_n)), key=forces_n.__getitem__)
    pressed = max(path)
    point = WorkingPoint(
        compression_m=pressed,
        speed_m_s=pressed / (max(path.index(pressed), 1) * dt_s),
        seconds=len(path_m) * dt_s,
    )
    rows: list[dict[str, Any]] = []
    for name, params in zip(kinds, terms, strict=True):
        term = find_term(name)[1]
        state, force, work, put_in = term.at_rest, 0.0, 0.0, 0.0
        along: list[float] = []
        for i in range(len(path_m)):
            before = force
            # The rate between this tick and the next, as far as ticks tell.
            ahead = path[i + 2] if i + 2 < len(path) else path[i + 1]
            speed = 0.5 * (ahead - path[i]) / dt_s
            force, state = term.law(params, state, path[i], path[i + 1], dt_s, speed)
            along.append(force)
            work += 0.5 * (before + force) * (path[i + 1] - path[i])
            if i == top:
                put_in = work
        rows.append(
            {
                "term": name,
                "peak_n": max(along, key=abs),
                "at_peak_n": along[top],
                "work_j": put_in,
                "lost_j": work,
                "expected_n": term.importance(params, point),
                "rates": [{"what": rate.what, "per_s": rate.per_s} for rate in term.rates(params, point)],
            }
        )
    whole = sum(row["at_peak_n"] for row in rows)
    for row in rows:
        row["share"] = row["at_peak_n"] / whole if whole != 0.0 else 0.0
    return {
        "touched": True,
        "peak_n": forces_n[top],
        "compression_m": pressed,
        "covers_m": forces_n[top] / plant.thing.skins_n_m,
        "speed_m_s": point.speed_m_s,
        "seconds": point.seconds,
        "terms": rows,
    }
