"""The findings on the paper: published figures beside ours, tested claims, and figures drawn again."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from itertools import product

from attrs import asdict

from graspsense.experiment_api import (
    CONTROLS,
    INKS,
    Findings,
    FoundTable,
    Picture,
    Section,
    Summary,
    bullets,
    code,
    confusion_table,
    control_cells,
    figure,
    one_grasp,
    pair,
    panels,
    paragraph,
    percent,
    reaching,
    tree_list,
)
from graspsense_paper import claims as claimed
from graspsense_paper.basis import BASES
from graspsense_paper.cases import PROTOCOLS, by_protocol
from graspsense_paper.claims import Claim, claims, curve
from graspsense_paper.grasping import grasp_results
from graspsense_paper.published import Published, published
from graspsense_paper.rows import (
    COUNTS,
    HEADER,
    RateComparison,
    people_beside_robot,
    rows,
    sample,
)
from graspsense_paper.verdict import UNTOLD, Verdict, counted


def findings(summary: Summary) -> Findings:
    """Return the findings on the parts of the paper that the experiment contains."""
    paper = published()
    held = rows(summary, paper)
    checked = claims(summary)
    tables = [_rates_table(held)] if held else []
    tables += [*_controls_table(summary, held), *_people_tables(summary, paper)]
    matrices, drawn = _matrices(summary, paper)
    tables += matrices
    if checked:
        tables.append(
            FoundTable(
                id="claims",
                title="Claims of the paper",
                header=claimed.HEADER,
                rows=tuple(claim.cells for claim in checked),
                verdicts=(2,),
            )
        )
    tables += _grasps_table(summary)
    whole = summary.planned.experiment.kind == "paper"
    return Findings(
        answer=_answer(held, checked),
        headline=_headline(held, checked),
        tables=tuple(tables),
        notes=_notes(paper, held)
        if whole
        else tuple(dict.fromkeys(row.published.note for row in held if row.published.note)),
        drawn=drawn,
        sections=tuple(_sections(summary, paper)),
        values={
            "rows": [row.as_json() for row in held],
            "claims": [asdict(claim) for claim in checked],
            "fitted_parameters": list(paper.fitted.parameters),
        },
    )


def _people_tables(summary: Summary, paper: Published) -> list[FoundTable]:
    """Return the rate of each state: people, the robot of the paper, and ours; nothing if there are no results."""
    robots = [
        (PROTOCOLS[protocol], robot)
        for name in ("table_5", "table_6")
        for protocol, robot in by_protocol(summary, name, "state").items()
    ]
    if not robots:
        return []
    header = ("state", "people (Table VI)", "their robot, 23 N (Table V)")
    return [
        FoundTable(
            id="people",
            title="State of an Odwalla bottle: people, the robot of the paper, and ours",
            header=(*header, *(f"ours, 23 N, each bottle in {words}" for words, _ in robots)),
            rows=tuple(people_beside_robot(paper, [robot for _, robot in robots])),
            note=paper.matrix("table_6").note,
        )
    ]


def _answer(held: Sequence[RateComparison], checked: Sequence[Claim]) -> str:
    """Return how many rates and claims agree with the paper, for each basis. Nothing is counted twice."""
    parts = []
    for basis, (protocol, words) in product(BASES, PROTOCOLS.items()):
        rates = [
            row.verdict
            for row in held
            if row.basis == basis and row.protocol == protocol and not row.published.repeats
        ]
        if rates:
            parts.append(f"of {len(rates)} {basis} rates with each bottle in {words}, {counted(rates)}")
    for basis in BASES:
        verdicts = [claim.verdict for claim in _counted_once(held, checked) if claim.basis == basis]
        if verdicts:
            parts.append(f"of {len(verdicts)} {basis} claim{'s' * (len(verdicts) > 1)}, {counted(verdicts)}")
    return "In simulation, " + "; ".join(parts) + "." if parts else "The table shows how the grasps went."


def _counted_once(held: Sequence[RateComparison], checked: Sequence[Claim]) -> list[Claim]:
    """Return the claims without those that rates decide which are compared as well."""
    compared = {row.published.id for row in held}
    return [
        claim for claim in checked if not claim.follows_from or not compared.issuperset(claim.follows_from)
    ]


def _headline(held: Sequence[RateComparison], checked: Sequence[Claim]) -> str:
    """Return how many predicted rates, under both protocols, and predicted claims agree, and how many differ."""
    parts = []
    rates: dict[str, list[Verdict]] = {}
    for row in held:
        if row.basis == "predicted" and not row.published.repeats:
            rates.setdefault(row.published.id, []).append(row.verdict)
    if rates:
        of_both = [rate[0] if len(set(rate)) == 1 else UNTOLD for rate in rates.values()]
        parts.append(f"of {len(rates)} predicted rates of the paper, {counted(of_both)}")
    claims = [claim.verdict for claim in _counted_once(held, checked) if claim.basis == "predicted"]
    if claims:
        parts.append(f"of {len(claims)} predicted claims, {counted(claims)}")
    return f"In simulation, {'; '.join(parts)}" if parts else ""


def _controls_table(summary: Summary, held: Sequence[RateComparison]) -> list[FoundTable]:
    """Return the table of the controls of the rates of the paper; none if none was measured."""
    lines: list[tuple[str, ...]] = []
    for row in held:
        published = row.published
        condition = by_protocol(summary, published.experiment, published.target, published.settings)[
            row.protocol
        ]
        if not condition.controls or published.repeats:
            continue
        line = (
            published.experiment,
            published.what.partition(", ")[2] if published.of_class else published.what,
            PROTOCOLS[row.protocol],
            sample(condition.rate),
            percent(condition.rate.mean),
            *control_cells(condition),
        )
        if line not in lines:
            lines.append(line)
    if not lines:
        return []
    table = FoundTable(
        id="controls",
        title="Controls",
        header=("experiment", "what", "each bottle in", "n", "our mean", *CONTROLS.values()),
        rows=tuple(lines),
        note="Means over the seeds, over all containers of the experiment. Before contact and with shuffled labels, "
        "the rate should not be above that of the most frequent label. The last column holds out whole bottles, where "
        "every label has at least two. With each bottle in one state, that takes trials of the tested label out of "
        "training, so that rates without information fall below that of the most frequent label.",
        numbers=4,
    )
    return [table]


def _matrices(summary: Summary, paper: Published) -> tuple[list[FoundTable], dict[str, str]]:
    """Return the printed matrices of Tables II and V beside ours, as tables and as the pictures above them.

    Counts of ours in a table are means over the seeds, for the protocols that the matrix is of.
    """
    people = paper.matrix("table_6")
    tables, drawn = [], {"people": confusion_table(people.confusion, f"People, {people.where}.")}
    for id_, target in (("table_2", "class"), ("table_5", "state")):
        theirs = paper.matrix(id_)
        ours, pictures = [], []
        for protocol, condition in by_protocol(summary, id_, target).items():
            confusion, seeds = condition.confusion, len(condition.by_seed)
            pictures.append(
                confusion_table(
                    confusion,
                    f"Ours, each bottle in {PROTOCOLS[protocol]}, {confusion.n} predictions of {seeds} seeds.",
                )
            )
            place = {label.rpartition(":")[2]: k for k, label in enumerate(confusion.labels)}
            if condition.case.data.states_per_instance != protocol or set(place) != set(theirs.labels):
                continue
            mean = [
                [confusion.counts[place[a]][place[b]] / seeds for b in theirs.labels] for a in theirs.labels
            ]
            ours += _matrix_rows(f"ours, {PROTOCOLS[protocol]}", theirs.labels, mean, 1)
        if ours:
            printed = confusion_table(
                theirs.confusion, f"{theirs.where}, as printed: {theirs.confusion.n} trials."
            )
            drawn[f"matrix_{id_}"] = pair(printed, "".join(pictures))
            tables.append(
                FoundTable(
                    id=f"matrix_{id_}",
                    title=f"Confusion matrix of {theirs.where}",
                    header=("matrix", "row", *(label.replace("_", " ") for label in theirs.labels)),
                    rows=(*_matrix_rows("printed", theirs.labels, theirs.confusion.counts, 0), *ours),
                    note=f"{theirs.note} Ours: rows are true, counts are means over the seeds.",
                    numbers=2,
                )
            )
    return tables, drawn


def _matrix_rows(
    name: str, labels: Sequence[str], counts: Sequence[Sequence[float]], digits: int
) -> list[tuple[str, ...]]:
    return [
        (name, label.replace("_", " "), *(f"{count:.{digits}f}" for count in row))
        for label, row in zip(labels, counts, strict=True)
    ]


def _grasps_table(summary: Summary) -> list[FoundTable]:
    """Return the table of how the grasps of each case went, by object; none if no case is of kind `grasp`."""
    lines: list[tuple[str, ...]] = []
    for case in summary.planned.cases:
        rows = [row for name, _, result in grasp_results(summary) if name == case.name for row in result.rows]
        for label in dict.fromkeys(row.label for row in rows):
            labelled = [row for row in rows if row.label == label]
            outcomes = Counter(row.outcome for row in labelled)
            lines.append(
                (
                    case.name,
                    label,
                    str(len(labelled)),
                    ", ".join(f"{outcome} {n}" for outcome, n in outcomes.most_common()),
                    _median([row.true_peak_force_n for row in labelled], 1.0, 1),
                    f"{max(row.true_peak_force_n for row in labelled):.1f}",
                    _median([row.speed_m_s for row in labelled], 1e3, 0),
                    _median([row.features.get("delta_t") for row in labelled], 1.0, 2),
                    str(sum(row.broken for row in labelled)),
                )
            )
    if not lines:
        return []
    table = FoundTable(
        id="grasps",
        title="Grasps by case and object",
        header=(
            "case",
            "object",
            "grasps",
            "outcomes",
            "median true peak, N",
            "largest true peak, N",
            "median speed at contact, mm/s",
            "median time to rest, s",
            "broken",
        ),
        rows=tuple(lines),
        note="The true peak is the force in the model, which the pads may miss.",
        numbers=4,
    )
    return [table]


def _median(values: Sequence[float | None], factor: float, digits: int) -> str:
    known = [factor * value for value in values if value is not None]
    return f"{statistics.median(known):.{digits}f}" if known else "none"


def _rates_table(held: Sequence[RateComparison]) -> FoundTable:
    return FoundTable(
        id="published",
        title="Published rates beside ours",
        header=HEADER,
        rows=tuple(row.cells for row in held),
        note="Our rates are means over the seeds. Each seed has its own bottles, grasps and folds. "
        "The paper does not tell whether each bottle was used in all states, so both are run. The printed rate is that "
        "of one run, so its error is at least as large as that of one run of ours. A rate agrees if the 95 % interval "
        f"of the difference lies within {100 * COUNTS:.0f} points. It differs if that interval does not, and excludes "
        "zero. Otherwise this cannot be told.",
        numbers=4,
        verdicts=(HEADER.index("verdict"),),
    )


def _notes(paper: Published, held: Sequence[RateComparison]) -> tuple[str, ...]:
    fitted = paper.fitted
    notes = [f"{row.published.where}: {row.published.note}" for row in held if row.published.note]
    return (
        f"Fitted to results of the paper and to the authors' tree were {fitted.count} numbers: "
        f"{'; '.join(fitted.parameters)}. {fitted.rests}",
        *dict.fromkeys(notes),
        *(f"{matrix.where}: {matrix.note}" for matrix in paper.matrices if matrix.note),
        *paper.inconsistencies.lines,
        *(f"Left out: {line}" for line in paper.left_out.lines),
    )


def _sections(summary: Summary, paper: Published) -> list[Section]:
    sections = []
    drawn = [*_calibration(summary), *_courses(summary)]
    if drawn:
        body = paragraph(
            "Force control closes with a constant effort. Hybrid control closes at 10 mm/s until both pads touch, "
            "and then "
            "squeezes. The drawn forces are the pads' readings, every 41 ms; the true peak may lie between two of them."
        ) + panels(drawn)
        sections.append(Section(id="figures", title="The figures of the paper with our data", body=body))
    sections += _tree(summary, paper)
    return sections


def _calibration(summary: Summary) -> list[str]:
    points = curve(summary)
    if not points:
        return []
    picture = Picture(300)
    x = reaching([force for _, force, *_ in points], 40, picture.width - 12, zero=True)
    y = reaching([c / 1000 for _, _, *both in points for c in both], 230, 26, zero=True)
    with picture.axes(x, y, "force on a pad, N", "sum of the pad's cells, 1000 counts"):
        for k, side in enumerate(("left", "right")):
            dots = [(x(point[1]), y(point[2 + k] / 1000)) for point in points]
            picture.dots(dots, INKS[k], f"{side} fingertip, N and 1000 counts")
    for k, side in enumerate(("left", "right")):
        picture.mark(40 + 120 * k, 286, INKS[k])
        picture.text(48 + 120 * k, 290, f"{side} fingertip")
    words = f"Raw sum of each pad's cells against the force on it, {len(points)} grasps of a wooden block"
    return [
        figure(
            picture.svg(words), "Fig. 4: raw sum of the fifteen cells against force, one colour a fingertip."
        )
    ]


def _courses(summary: Summary) -> list[str]:
    """Return the grasps of Figs. 5 and 6, of the first seed."""
    figures = []
    case_of = {case.name: case for case in summary.planned.cases}
    for name, seed, result in grasp_results(summary):
        case = case_of[name]
        if (case.part or summary.planned.name) not in ("fig_5", "fig_6") or seed != summary.planned.seeds[0]:
            continue
        for grasp in result.grasps:
            row = result.rows[grasp.trial]
            control = str(case.levels.get("variant", ""))
            number = "Fig. 5" if control == "force" else "Fig. 6"
            caption = (
                f"{number}: {control} control on the {grasp.label}, 23 N. Contact {row.contact_s or 0:.2f} s after the "
                f"start, at {1e3 * (row.speed_m_s or 0):.0f} mm/s; true peak {row.true_peak_force_n:.0f} N."
            )
            figures.append(one_grasp(grasp, caption))
    return figures


def _tree(summary: Summary, paper: Published) -> list[Section]:
    """Return the authors' tree beside the first tree of ours."""
    seed = summary.planned.seeds[0]
    for name in ("table_5", "table_6", "table_4"):
        for case in summary.planned.cases:
            result = summary.recognition(case.name, seed)
            if (case.part or summary.planned.name) != name or result is None:
                continue
            tree = next((classifier.tree for classifier in result.classifiers if classifier.tree), None)
            if tree is None:
                continue
            theirs = code("\n".join(paper.authors_tree.lines))
            body = (
                pair(f"<h3>The authors' tree</h3>{theirs}", f"<h3>Ours</h3>{tree_list(tree)}")
                + bullets([paper.authors_tree.note])
                + paragraph(f"Ours is grown on all grasps of seed {seed} at 23 N.")
            )
            return [Section(id="trees", title="Our tree beside the authors' tree", body=body)]
    return []
