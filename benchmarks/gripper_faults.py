"""Inject faults in every phase of a grasp with an emulated PR2 gripper, and print what its fingers then did.

    python benchmarks/gripper_faults.py [--pushed] [--short]

The emulated board is treated as a real gripper, with the limits of a first closing. Each fault begins at five times:
while the fingers open, early and late in the approach, in the squeeze, and in the hold; those times are taken from a
grasp without a fault. The fault is on the left fingertip, then on the right one. The controllers are the three of
graspsense, and four hostile ones. Effort and force are those of the simulated body, whatever the board reported.

The table has a row for each fault and group of controllers, with the worst of its grasps. `--pushed` prints instead how
far one pad pushes a sound object before the other pad feels it, on the simulated gripper: what a limit on one finger
alone has to endure.
`--short` runs a few of the grasps. Emulated and simulated; nothing was measured on a gripper.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import inf
from typing import Any, Final

import numpy as np
from arguments import parser_of
from attrs import evolve, frozen

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import Grasp, run_grasp
from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    HOLD,
    SQUEEZE,
    Controller,
    SensorBackend,
    create,
)
from graspsense.report.found_table import markdown_table
from graspsense.testing.laws import HOSTILE, HostileController
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config

OBJECT: Final = "odwalla:full_open"
SEED: Final = 0
CONTROLLERS: Final = ("hybrid", "velocity", "force")
RUN: Final = RunConfig(grasp_timeout_s=10.0)


@frozen
class Injected:
    """A fault as settings of the emulated board, but for its time and side; `sided`: it is of one fingertip."""

    name: str
    settings: Mapping[str, Any]
    time_key: str
    sided: bool = False


FAULTS: Final = (
    Injected("fingertip absent", {"pad_fault": "absent"}, "pad_at_s", sided=True),
    Injected("fingertip stuck", {"pad_fault": "stuck"}, "pad_at_s", sided=True),
    Injected("fingertip reads 0", {"pad_fault": "zero"}, "pad_at_s", sided=True),
    Injected("zero drifts by 50 counts/s", {"drift_counts_s": 50.0}, "pad_at_s", sided=True),
    Injected("zero drifts by -50 counts/s", {"drift_counts_s": -50.0}, "pad_at_s", sided=True),
    Injected("both zeros drift by 200 counts/s", {"drift_counts_s": 200.0}, "pad_at_s"),
    Injected("both fingertips stuck", {"pad_fault": "stuck"}, "pad_at_s"),
    Injected("cell images stop", {"image_fault": "frozen"}, "image_at_s"),
    Injected("encoder fault bit", {"status_bits": 4}, "status_at_s"),
    Injected("motor applies twice the command", {"motor_gain": 2.0}, "motor_at_s"),
    Injected("motor applies a third of the command", {"motor_gain": 0.33}, "motor_at_s"),
    Injected("motor turns the wrong way", {"motor_gain": -1.0}, "motor_at_s"),
    Injected("reports five times the effort", {"effort_report_gain": 5.0}, "effort_report_at_s"),
    Injected("clock of the board stands still", {"clock_rate": 0.0}, "clock_at_s"),
)


@frozen
class FaultyGrasp:
    """What the fingers did in a grasp with a fault that began in this phase."""

    fault: str
    side: str
    phase: str
    controller: str
    largest_effort_n: float
    strong_s: float
    largest_force_n: float
    released_after_s: float
    """Time from the fault to the release; infinity if there was no fault."""
    outcome: str
    words: str


def grasped(controller: Controller[Any], faults: FaultConfig, seed: int = SEED, **body: Any) -> Grasp:
    """Grasp with the emulated board, treated as a real gripper; `body` are settings of its simulated fingers."""
    config = Pr2Config(
        transport="emulated",
        pace="device",
        calibration="none",
        object=OBJECT,
        faults=faults,
        body_config=body,
    )
    backend: SensorBackend[Any] = Pr2Backend(config).dry_run_backend()
    return run_grasp(backend, controller, evolve(RUN, seed=seed))


def controller_named(name: str) -> Controller[Any]:
    """Return one of graspsense's controllers, or a hostile one."""
    if name in HOSTILE:
        return HostileController((name, EFFORT))
    built: Controller[Any] = create("controller", name)
    return built


def moments(grasp: Grasp) -> dict[str, float]:
    """Return five device times (s) of a grasp without a fault: in the opening, the approach, the squeeze, the hold."""
    trace = grasp.trace
    begins = {phase: trace.t_s[trace.phase == phase] for phase in (APPROACH, SQUEEZE, HOLD)}
    approach, squeeze, hold = (begins[phase] for phase in (APPROACH, SQUEEZE, HOLD))
    start, end = float(approach[0]), float(approach[-1])
    return {
        "opening": 0.5 * start,
        "approach, early": start + 0.2 * (end - start),
        "approach, late": start + 0.8 * (end - start),
        "squeeze": float(np.mean(squeeze)) if len(squeeze) else end,
        "hold": float(np.mean(hold)) if len(hold) else float(trace.t_s[-1]),
    }


def result_of(fault: str, side: str, phase: str, controller: str, at_s: float, grasp: Grasp) -> FaultyGrasp:
    """Return what the fingers did."""
    report, trace = grasp.report, grasp.trace
    closing = np.flatnonzero(trace.phase <= HOLD)
    end_s = float(trace.t_s[closing[-1]]) if len(closing) else 0.0
    return FaultyGrasp(
        fault,
        side,
        phase,
        controller,
        float(report["largest_effort_n"]),
        float(report["seconds_above_30_n"]),
        float(report["largest_force_n"]),
        end_s - at_s,
        grasp.outcome.words,
        "; ".join(warning.split(":")[0] for warning in grasp.warnings),
    )


def injected(
    controllers: Iterable[str],
    faults: Iterable[Injected] = FAULTS,
    sides: Iterable[str] = ("left", "right"),
    **body: Any,
) -> Iterator[FaultyGrasp]:
    """Grasp with each of these faults at each of five times, on each side, under each controller."""
    sides = tuple(sides)
    for name in controllers:
        healthy = grasped(controller_named(name), FaultConfig(), **body)
        yield result_of("none", "", "", name, inf, healthy)
        for fault in faults:
            for side in sides if fault.sided else ("both",):
                for phase, at_s in moments(healthy).items():
                    settings = {**fault.settings, fault.time_key: at_s}
                    if fault.sided:
                        settings["pad_side"] = side
                    grasp = grasped(controller_named(name), FaultConfig(**settings), **body)
                    yield result_of(fault.name, side, phase, name, at_s, grasp)


def hostile(**body: Any) -> Iterator[FaultyGrasp]:
    """Grasp under each hostile controller, without a fault and with a stuck fingertip."""
    stuck = FaultConfig(pad_fault="stuck", pad_side="left", pad_at_s=2.0)
    for name in HOSTILE:
        law = controller_named(name)
        yield result_of("none", "", "", name, inf, grasped(law, FaultConfig(), **body))
        yield result_of("fingertip stuck", "left", "2 s", name, 2.0, grasped(law, stuck, **body))


def table(rows: Iterable[FaultyGrasp]) -> list[str]:
    """Return the worst of each fault and controller as a table in Markdown."""
    groups: dict[tuple[str, str], list[FaultyGrasp]] = {}
    for row in rows:
        groups.setdefault((row.fault, row.controller), []).append(row)
    cells = []
    for (fault, controller), group in groups.items():
        outcomes = ", ".join(dict.fromkeys(row.outcome for row in group))
        told = ", ".join(dict.fromkeys(word for row in group for word in row.words.split("; ") if word))
        effort_n, strong_s, force_n, released_s = (
            max(getattr(row, name) for row in group)
            for name in ("largest_effort_n", "strong_s", "largest_force_n", "released_after_s")
        )
        # A fault in the opening counts from the moment at which the fingers close.
        released = "" if released_s == -inf else f"{released_s:.2f} s"
        figures = (f"{effort_n:.1f} N", f"{strong_s:.2f} s", f"{force_n:.1f} N", released)
        cells.append((fault, controller, str(len(group)), *figures, outcomes, told))
    heads = (
        "fault",
        "controller",
        "grasps",
        "greatest effort",
        "longest above 30 N",
        "greatest force on a pad",
    )
    return markdown_table((*heads, "longest until release", "outcomes", "told"), cells)


def pushed(instances: int) -> list[str]:
    """Return as a table how far, how long and how hard one pad pushes each object of the catalogue, at most."""
    gripper, controller = create("sensor-backend", "sim"), create("controller", "hybrid")
    contact_n = controller.contact_force_n()

    def push(trace: Any) -> tuple[float, float, float]:
        left, right = trace.force_left_n >= contact_n, trace.force_right_n >= contact_n
        alone, both = np.flatnonzero(left | right), np.flatnonzero(left & right)
        if not len(both):
            return 0.0, 0.0, 0.0
        begin, end = alone[0], both[0]
        forces = np.maximum(trace.force_left_n, trace.force_right_n)[begin:end]
        travel_m, time_s = trace.gap_m[begin] - trace.gap_m[end], trace.t_s[end] - trace.t_s[begin]
        return float(travel_m), float(time_s), float(forces.max(initial=0.0))

    rows = []
    for name in (name for kind in gripper.objects() for name in kind.full_names):
        scenes = [f"{name}#{number}" for number in range(instances)]
        grasps = gripper.run_many(controller, scenes, list(range(instances)), run=RunConfig(), extract=push)
        travel_m, time_s, force_n = np.max([grasp.extracted for grasp in grasps], axis=0)
        rows.append((name, f"{travel_m * 1e3:.1f} mm", f"{time_s:.2f} s", f"{force_n:.1f} N"))
    return markdown_table(("object", "travel", "time", "force"), rows)


def main() -> None:
    """Run the grasps and print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--pushed", action="store_true", help="how far one pad pushes a sound object")
    given = parser.parse_args()
    if given.pushed:
        print("\n".join(pushed(1 if given.short else 12)))
        return
    rows = list(injected(("hybrid",), FAULTS[:1], ("left",)) if given.short else injected(CONTROLLERS))
    rows += [next(hostile())] if given.short else hostile()
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
