"""Writes `docs/which_gripper.md` and `benchmarks/results/which_gripper.md` from the results of the experiment.

graspsense experiment which_gripper --out FOLDER
python docs/which_gripper.py FOLDER
"""

from __future__ import annotations

import argparse
from pathlib import Path

from graspsense import Results, summarise
from graspsense.experiments.summary import ConditionResult, Summary
from graspsense.experiments.versions import where_measured

PAGE = Path(__file__).with_name("which_gripper.md")
THINGS = PAGE.parents[1] / "benchmarks" / "results" / "which_gripper.md"
BEGIN, END = "<!-- tables: which_gripper.py -->\n", "<!-- end of the tables -->\n"


def of_target(summary: Summary, target: str) -> list[ConditionResult]:
    """Return the conditions of this target, in the order of the file."""
    return [condition for condition in summary.conditions if condition.target == target]


def told_apart(condition: ConditionResult) -> dict[str, str]:
    """Return for each thing how many of its grasps were recognised, and what the others were most often taken for."""
    matrix, shares = condition.confusion, {}
    for label, row in zip(matrix.labels, matrix.counts, strict=True):
        own = row[matrix.labels.index(label)]
        others = [(count, other) for other, count in zip(matrix.labels, row, strict=True) if other != label]
        count, other = max(others)
        total = sum(row)
        entry = f"{own} of {total}" if total else "-"
        shares[label] = entry + (f" ({count} as {other})" if count else "")
    return shares


def table_of_grippers(summary: Summary) -> str:
    """Return the rates of each gripper as Markdown."""
    both, objects = of_target(summary, "both"), of_target(summary, "class")
    lines = ["| gripper | object and state recognised | object recognised | grasps |", "|---|---|---|---|"]
    for condition, of_class in zip(both, objects, strict=True):
        lines.append(
            f"| {condition.name} | {condition.rate.words} | {of_class.rate.words} | {condition.confusion.n} |"
        )
    return "\n".join(lines) + "\n"


def table_of_things(summary: Summary) -> str:
    """Return what each gripper takes each thing for as Markdown."""
    both = of_target(summary, "both")
    columns = [told_apart(condition) for condition in both]
    lines = [f"| thing | {' | '.join(condition.name for condition in both)} |", "|---|" + "---|" * len(both)]
    for label in both[0].confusion.labels:
        lines.append(f"| `{label}` | {' | '.join(column[label] for column in columns)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write both pages."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    results = Results(parser.parse_args().folder)
    summary = summarise(results.experiment(), results)
    text = PAGE.read_text(encoding="utf-8")
    head, tail = text.split(BEGIN)
    after = tail.split(END)[1]
    measured = where_measured().partition(", python")[0]
    written = f"{BEGIN}\nMeasured: {measured}.\n\n{table_of_grippers(summary)}\n{END}"
    PAGE.write_text(head + written + after, encoding="utf-8")
    text = THINGS.read_text(encoding="utf-8").partition("Measured: ")[0]
    THINGS.write_text(f"{text}Measured: {measured}.\n\n{table_of_things(summary)}", encoding="utf-8")


if __name__ == "__main__":
    main()
