"""What came of the paper: every published figure beside ours, every claim with its number, figures redrawn."""

from __future__ import annotations

import statistics
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from graspsense.core.tree import TreeNode
from graspsense.experiments.findings import Findings, FoundTable, code
from graspsense.experiments.paper import claims as claimed
from graspsense.experiments.paper.claims import Claim, claims, curve
from graspsense.experiments.paper.published import Published, published
from graspsense.experiments.paper.rows import HEADER, Row, arm_of, people_beside_robot, rows
from graspsense.experiments.summary import Summary
from graspsense.report.html import Section, bullets, figure, pair, panels, paragraph
from graspsense.report.matrix import confusion_table
from graspsense.report.svg import INKS, Picture, reaching
from graspsense.report.traces import one_grasp
from graspsense.report.tree import tree_list


def findings(summary: Summary) -> Findings:
    """Return what came out, of as much of the paper as the experiment holds."""
    paper = published()
    held = rows(summary, paper)
    checked = claims(summary)
    tables = []
    if held:
        tables.append(_rates_table(held))
    people = arm_of(summary, "table_5", "state") or arm_of(summary, "table_6", "state")
    if people is not None:
        tables.append(
            FoundTable(
                id="people",
                title="People, the paper's robot and ours: the state of an Odwalla bottle",
                header=("state", "people (Table VI)", "their robot, 23 N (Table V)", "ours, 23 N"),
                rows=tuple(people_beside_robot(paper, people)),
                note=paper.matrix("table_6").note,
            )
        )
    if checked:
        tables.append(
            FoundTable(
                id="claims",
                title="What the paper says, and whether it holds here",
                header=claimed.HEADER,
                rows=tuple(one.cells for one in checked),
            )
        )
    grasps = _grasps_table(summary)
    if grasps is not None:
        tables.append(grasps)
    failing = _failing(held, checked)
    if failing:
        tables.append(
            FoundTable(
                id="failures",
                title="What does not come out, and what makes it fail",
                header=("what", "what makes it fail"),
                rows=tuple(failing),
            )
        )
    whole = summary.planned.experiment.kind == "paper"
    return Findings(
        answer=_answer(held, checked),
        tables=tuple(tables),
        notes=_notes(paper, held)
        if whole
        else tuple(row.published.note for row in held if row.published.note),
        sections=tuple(_sections(summary, paper)),
        values={
            "rows": [row.as_json() for row in held],
            "claims": [one.as_json() for one in checked],
            "fitted_parameters": list(paper.fitted.parameters),
        },
    )


def _answer(held: Sequence[Row], checked: Sequence[Claim]) -> str:
    parts = []
    for sort in ("predicted", "fitted"):
        of = [row for row in held if row.published.sort == sort]
        if of:
            good = sum(row.within for row in of)
            parts.append(f"{good} of {len(of)} {sort} rates have the published one within one further run")
    for sort in ("predicted", "fitted"):
        of_claims = [one for one in checked if one.sort == sort]
        if of_claims:
            good = sum(one.holds for one in of_claims)
            parts.append(f"{good} of {len(of_claims)} {sort} claims hold")
    return "In simulation " + "; ".join(parts) + "." if parts else "How the grasps went stands in the table."


def _grasps_table(summary: Summary) -> FoundTable | None:
    """Return how the grasps of each case went, by what was grasped; None where no case is of kind `grasp`."""
    found: list[tuple[str, ...]] = []
    for case in summary.planned.cases:
        rows = [
            row
            for (name, _), result in summary.results.items()
            if name == case.name
            for row in result.get("rows", ())
        ]
        for label in dict.fromkeys(row["label"] for row in rows):
            of = [row for row in rows if row["label"] == label]
            outcomes = Counter(row["outcome"] for row in of)
            found.append(
                (
                    case.name,
                    label,
                    str(len(of)),
                    ", ".join(f"{outcome} {n}" for outcome, n in outcomes.most_common()),
                    _median(of, "true_peak_force_n", 1.0, 1),
                    f"{max(row['true_peak_force_n'] for row in of):.1f}",
                    _median(of, "speed_m_s", 1e3, 0),
                    _median(of, "delta_t", 1.0, 2),
                    str(sum(bool(row["broken"]) for row in of)),
                )
            )
    if not found:
        return None
    return FoundTable(
        id="grasps",
        title="How the grasps went",
        header=(
            "case",
            "grasped",
            "grasps",
            "ended",
            "median true peak, N",
            "greatest, N",
            "median speed at the contact, mm/s",
            "median time to rest, s",
            "broken",
        ),
        rows=tuple(found),
        note="The true peak is the model's own, whatever the pads saw of it.",
        numbers=4,
    )


def _median(rows: Sequence[Mapping[str, Any]], key: str, factor: float, digits: int) -> str:
    known = [factor * row[key] for row in rows if row[key] is not None]
    return f"{statistics.median(known):.{digits}f}" if known else "none"


def _rates_table(held: Sequence[Row]) -> FoundTable:
    return FoundTable(
        id="published",
        title="Published rates beside ours",
        header=HEADER,
        rows=tuple(row.cells for row in held),
        note="Ours are means over the seeds; each seed has bottles, grasps and folds of its own. `published within "
        "that` holds the printed rate, by its counts, against where one further run of ours would lie at 95 %. Where "
        "one more run scatters widely that is easily met: the last column asks the reverse.",
        numbers=3,
    )


@cache
def _reasons() -> Mapping[str, str]:
    """Return what makes a row or claim fail, by its id, as it was found out and written down."""
    text = files("graspsense.experiments.paper").joinpath("reasons.toml").read_text(encoding="utf-8")
    return {str(key): str(value) for key, value in tomllib.loads(text).items()}


UNKNOWN = "not looked into yet"


def _failing(held: Sequence[Row], checked: Sequence[Claim]) -> list[tuple[str, str]]:
    found = [
        (
            f"{row.published.where}, {row.published.what} ({row.published.sort}): printed "
            f"{100 * row.published.printed:.1f} %, here {100 * row.ours.mean:.1f} %",
            _reasons().get(row.published.id, UNKNOWN),
        )
        for row in held
        if not row.within or row.indistinguishable is False
    ]
    return found + [
        (f"{one.says} ({one.sort}): {one.number}", _reasons().get(one.id, UNKNOWN))
        for one in checked
        if not one.holds
    ]


def _notes(paper: Published, held: Sequence[Row]) -> tuple[str, ...]:
    fitted = paper.fitted
    return (
        f"{fitted.count} numbers were fitted to Tables II and III at 20 N and to the authors' tree: "
        f"{'; '.join(fitted.parameters)}. {fitted.rests}",
        *(f"{row.published.where}: {row.published.note}" for row in held if row.published.note),
        *(f"{one.where}: {one.note}" for one in paper.matrices if one.note),
        *paper.inconsistencies.lines,
    )


def _sections(summary: Summary, paper: Published) -> list[Section]:
    found = []
    matrices = _matrices(summary, paper)
    if matrices:
        found.append(Section(id="matrices", title="What is taken for what, theirs and ours", body=matrices))
    drawn = [*_calibration(summary), *_courses(summary)]
    if drawn:
        body = paragraph(
            "Force control drives in with a constant effort; hybrid control closes at 10 mm/s until both pads touch "
            "and squeezes then. The forces drawn are those that the pads felt, every 41 ms; the true peak lies between."
        ) + panels(drawn)
        found.append(Section(id="figures", title="The figures again", body=body))
    found += _tree(summary, paper)
    return found


def _matrices(summary: Summary, paper: Published) -> str:
    body = []
    for id_, target in (("table_2", "class"), ("table_5", "state")):
        arm = arm_of(summary, id_, target)
        if arm is None:
            continue
        theirs = paper.matrix(id_)
        body.append(
            pair(
                confusion_table(
                    theirs.confusion, f"{theirs.where}, as printed: {theirs.confusion.n} trials."
                ),
                confusion_table(
                    arm.confusion, f"Ours, {arm.confusion.n} answers of {len(arm.judged)} seeds."
                ),
            )
            + paragraph(theirs.note)
        )
    if body:
        theirs = paper.matrix("table_6")
        body.append(confusion_table(theirs.confusion, f"People, {theirs.where}.") + paragraph(theirs.note))
    return "".join(body)


def _calibration(summary: Summary) -> list[str]:
    points = curve(summary)
    if not points:
        return []
    picture = Picture(300)
    x = reaching([force for _, force, *_ in points], 40, picture.width - 12, zero=True)
    y = reaching([c / 1000 for _, _, *both in points for c in both], 230, 26, zero=True)
    picture.x_axis(x, 26, 230, "force on a pad, N")
    picture.y_axis(y, 40, picture.width - 12, "sum of the pad's cells, 1000 counts")
    for k, side in enumerate(("left", "right")):
        picture.dots([(x(point[1]), y(point[2 + k] / 1000)) for point in points], INKS[k])
        picture.mark(40 + 120 * k, 286, INKS[k])
        picture.text(48 + 120 * k, 290, f"{side} fingertip")
    words = f"Raw sum of each pad's cells against the force on it, {len(points)} grasps of a wooden block"
    return [
        figure(
            picture.svg(words), "Fig. 4: raw sum of the fifteen cells against force, one colour a fingertip."
        )
    ]


def _courses(summary: Summary) -> list[str]:
    found = []
    of = {one.name: one for one in summary.planned.cases}
    for (name, seed), result in summary.results.items():
        case = of[name]
        if (case.part or summary.planned.name) not in ("fig_5", "fig_6") or seed != summary.planned.seeds[0]:
            continue
        for course in result.get("grasps", ()):
            row = result["rows"][course["trial"]]
            how = str(case.at.get("variant", ""))
            fig = "Fig. 5" if how == "force" else "Fig. 6"
            found.append(
                one_grasp(
                    course,
                    f"{fig}: {how} control on the {course['label']}, 23 N. Contact {row['contact_s'] or 0:.2f} s "
                    f"after the start, at {1e3 * (row['speed_m_s'] or 0):.0f} mm/s; "
                    f"true peak {row['true_peak_force_n']:.0f} N.",
                )
            )
    return found


def _tree(summary: Summary, paper: Published) -> list[Section]:
    for name in ("table_5", "table_6", "table_4"):
        for case in summary.planned.cases:
            result: Mapping[str, Any] | None = summary.results.get((case.name, summary.planned.seeds[0]))
            if (case.part or summary.planned.name) != name or result is None:
                continue
            for judged in result.get("judged", ()):
                if judged.get("tree"):
                    nodes = [TreeNode.from_json(node) for node in judged["tree"]]
                    theirs = "\n".join(paper.authors_tree.lines)
                    body = (
                        pair(f"<h3>The authors' tree</h3>{code(theirs)}", f"<h3>Ours</h3>{tree_list(nodes)}")
                        + bullets([paper.authors_tree.note])
                        + paragraph(
                            f"Ours is grown on all grasps of seed {summary.planned.seeds[0]} at 23 N."
                        )
                    )
                    return [Section(id="trees", title="The learned tree beside the authors' own", body=body)]
    return []
