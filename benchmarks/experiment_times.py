"""Measure the processor time per trial of the experiments that are installed.

    python benchmarks/experiment_times.py [NAME...] [--short]

Runs two tasks of each experiment in this process and prints the figures that the entries of the experiments and of
their kinds have as `seconds_per_trial`, from which `graspsense experiment` tells how long an experiment takes. That of
a kind is the median over its experiments. `graspsense.experiments.duration` names the machine. `--short` measures the
first experiment alone.
"""

from __future__ import annotations

from statistics import median

from arguments import parser_of

from graspsense.experiments.cases import number_of_trials
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.experiment_file import read_experiment, shipped
from graspsense.experiments.versions import where_measured


def seconds_per_trial(name: str) -> tuple[str, float]:
    """Return the kind of an experiment, and the processor seconds per trial of its last case.

    The first case with the first seed goes before: it imports, compiles and keeps curves for the page.
    """
    planned = read_experiment(name, ["seeds=2"])
    case = planned.cases[-1]
    for task in (planned.task(planned.cases[0], planned.seeds[0]), planned.task(case, planned.seeds[1])):
        (done,) = Serial().run([task])
        assert done.result is not None, done
    sources = [source for source in (case.data, case.test) if source is not None]
    trials = sum(number_of_trials(case.settings, source) or 0 for source in sources)
    return planned.experiment.kind, done.made.cpu_seconds / trials


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    given = parser.parse_args()
    asked = given.names or [name for name in shipped() if not read_experiment(name).parts]
    of_kind: dict[str, list[float]] = {}
    for name in asked[:1] if given.short else asked:
        kind, share = seconds_per_trial(name)
        of_kind.setdefault(kind, []).append(share)
        print(f"{name}: {share:.3g} s per trial", flush=True)
    for kind, shares in of_kind.items():
        print(f"kind {kind}: {median(shares):.3g} s per trial")
    print(where_measured())


if __name__ == "__main__":
    main()
