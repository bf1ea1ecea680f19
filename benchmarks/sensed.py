"""Whether distributions of features and recognition are those of the reference, with pads and spread. Simulated.

    python benchmarks/sensed.py [--accuracy 0.01] [--seeds 20] [--instances 10] [--first N] [--table] [--short]

The containers of the catalogue in all states are grasped with the default pads and spread, with the default model for
an accuracy and with the reference: the same individuals with the same seeds. For each feature the distance of the two
distributions is given in standard deviations of the reference, with its 95 % bound, the p-value of a difference and the
power of the test of equivalence (`graspsense.evaluation.distribution`). The limit is the accuracy. The seeds are fresh
unless `--first` names the first one.
"""

from __future__ import annotations

import argparse
import json
import secrets

from attrs import asdict

from graspsense.core.components.config import resolve
from graspsense.experiments.sensed import SensedTrade, sensed_trade
from graspsense.experiments.versions import where_measured
from graspsense.simulator_api import SimulationVariant
from graspsense_sim_gripper.run.variants import variants


def table(trade: SensedTrade, accuracy: float) -> list[str]:
    """Return the figures in Markdown."""
    lines = [
        f"{len(trade.seeds)} seeds from {trade.seeds[0]}, {trade.grasps} grasps each, sensor {trade.sensor}, limit "
        f"{accuracy:g} standard deviations; {where_measured()}.",
        "",
        "| feature | distance | below, at 95 % | p of a difference | power | within |",
        "|---|---|---|---|---|---|",
    ]
    for point in trade.points:
        if point.role == "reference":
            continue
        lines += [
            f"| `{distance.feature}` | {distance.distance:.1e} | {distance.upper:.1e} | {distance.p_difference:.2g} "
            f"| {distance.power:.2g} | {'yes' if distance.is_equivalent else 'not shown'} |"
            for distance in point.distances
        ]
        test = point.equivalence
        if test is not None:
            low, high = test.interval
            lines += [
                "",
                f"Recognition: {100 * test.difference:+.2f} points from the reference (90 %: {100 * low:+.2f} to "
                f"{100 * high:+.2f}), {'' if test.is_equivalent else 'not shown to be '}equivalent within "
                f"{100 * test.margin:g} points; power {test.power:.2g}.",
            ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--accuracy", type=float, default=0.01)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--instances", type=int, default=10)
    parser.add_argument("--first", type=int)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true")
    form.add_argument("--table", action="store_true", help="Markdown")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    first_seed = given.first if given.first is not None else 1000 + secrets.randbelow(100_000)
    objects: tuple[str, ...] = ()
    compiled = "always"
    if given.short:
        given.seeds, given.instances, objects, compiled = 2, 2, ("toy", "block"), "never"
    settings = resolve("default", options=["classifier.type=c45"])
    reference = next(variant for variant in variants() if variant.role == "reference")
    if given.short:
        # The reference takes a second a grasp in the interpreter.
        reference = SimulationVariant(
            method="fixed steps",
            fidelity="scene",
            step="1 ms",
            settings={"fidelity": "scene", "step_s": 1e-3, "compile": compiled},
            role="reference",
        )
    chosen = SimulationVariant(
        method="as chosen",
        fidelity="scene",
        step=f"{given.accuracy:g}",
        settings={"accuracy": given.accuracy, "compile": compiled},
    )
    trade = sensed_trade(
        settings,
        objects=objects,
        instances=given.instances,
        seeds=range(first_seed, first_seed + given.seeds),
        variants=(reference, chosen),
    )
    if given.json:
        print(json.dumps(asdict(trade), indent=2))
    else:
        print("\n".join(table(trade, given.accuracy)))


if __name__ == "__main__":
    main()
