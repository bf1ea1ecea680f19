"""Running an experiment: every task without a result is run, and each result is stored immediately."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from attrs import field, frozen

from graspsense.core.components.caller import option
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.grasp.interrupts import Interrupts
from graspsense.core.values.errors import ConfigError, counted, listed
from graspsense.experiments.executors.executor import Executor, ExecutorLost
from graspsense.experiments.experiment import Planned
from graspsense.experiments.results import Results
from graspsense.experiments.task import Task, TaskResult
from graspsense.experiments.timing import TimeLeft

STORE_FILE = "store.sqlite"
"""A folder with this file is a store of trials. This package may not import the store itself."""


@frozen(kw_only=True)
class Account:
    """The numbers of tasks: in `total`, `kept` from an earlier run, `done` in this run, and `failed`.

    `stopped` is the reason if the run ended early, and empty otherwise.
    """

    total: int
    kept: int
    done: int
    failed: tuple[TaskResult, ...] = ()
    stopped: str = ""
    notes: tuple[str, ...] = field(default=())

    @property
    def missing(self) -> int:
        """Number of tasks without a result."""
        return self.total - self.kept - self.done - len(self.failed)

    @property
    def complete(self) -> bool:
        """Whether every task has a result."""
        return self.kept + self.done == self.total

    @property
    def words(self) -> str:
        """The numbers in one sentence."""
        parts = [f"{self.done} done now"]
        if self.kept:
            parts.append(f"{self.kept} kept from before")
        if self.failed:
            parts.append(f"{len(self.failed)} failed")
        if self.missing:
            parts.append(f"{self.missing} not done")
        return f"{counted(self.total, 'task')}: {', '.join(parts)}"


def refuse_store(folder: Path) -> None:
    """Raise ConfigError if `folder` is a file, or a store of trials, whose page that of an experiment would replace."""
    if any(path.is_file() for path in (folder, *folder.parents)):
        raise ConfigError(
            f"{folder} is no folder: name one for the results ({option('out', python='Results')})"
        )
    if (folder / STORE_FILE).exists():
        raise ConfigError(
            f"{folder} is a store of trials, and the page of an experiment would replace its own: name another "
            f"folder ({option('out', python='Results')})"
        )


def run_experiment(
    planned: Planned,
    results: Results,
    executor: Callable[[], Executor],
    *,
    resume: bool = False,
    command: str = "",
    progress: Callable[[str, int, int], None] | None = None,
    said: Callable[[str], None] | None = None,
) -> Account:
    """Run every task that has no result yet, and return the account of the run.

    `executor` is called only if a result is missing. Ctrl-C, the loss of the workers and a full disk stop the run; the
    results until then are kept. Raises ConfigError if the folder is a store of trials, or has results already and
    `resume` is not set; SaveFailed if nothing can be written at the start.
    """
    tasks = list({task.key: task for task in planned.tasks()}.values())
    refuse_store(results.folder)
    with results.alone():
        if results.any() and not resume:
            raise ConfigError(
                f"there are results in {results.folder} already. {option('resume', python='resume=True')} does "
                f"what is missing there; "
                f"another folder ({option('out', python='Results')}) begins anew"
            )
        known = {done.key for done in results.finished(tasks) if done.result is not None}
        changed = _changed_inputs(results, planned)
        results.begin(planned, command)
        todo = [task for task in tasks if task.key not in known]
        ended, stopped = _run_tasks(todo, len(tasks), results, executor, progress, said) if todo else ([], "")
        # Counted on the disk: an interrupt can come while a result is being written.
        new = results.finished(ended)
    return Account(
        total=len(tasks),
        kept=len(known),
        done=sum(result.result is not None for result in new),
        failed=tuple(result for result in new if result.result is None),
        stopped=stopped,
        notes=changed,
    )


def _run_tasks(
    todo: Sequence[Task],
    total: int,
    results: Results,
    executor: Callable[[], Executor],
    progress: Callable[[str, int, int], None] | None,
    said: Callable[[str], None] | None,
) -> tuple[list[Task], str]:
    """Run these of `total` tasks and add each result.

    Return the tasks that ended, and the reason if the run ended early.
    """
    running: Executor | None = None
    left = TimeLeft(len(todo))
    ended: list[Task] = []
    failures = 0
    try:
        with Interrupts():
            running = executor()
            left.workers = running.workers
            of_key = {task.key: task for task in todo}
            for result in running.run(todo):
                ended.append(of_key[result.key])
                results.add(result)
                left.add(result.made.seconds)
                if result.result is None:
                    failures += 1
                    if said is not None:
                        said(f"{result.name} failed: {result.reason}")
                if progress is not None:
                    what = f"tasks, {left.words}" + (f", {failures} failed" if failures else "")
                    progress(what, total - len(todo) + len(ended), total)
    except KeyboardInterrupt:
        return ended, "interrupted"
    except (ExecutorLost, SaveFailed) as lost:
        return ended, str(lost)
    finally:
        if running is not None:
            running.close()
    return ended, ""


def _changed_inputs(results: Results, planned: Planned) -> tuple[str, ...]:
    """Return a note on the inputs that differ from those of the results in the folder."""
    earlier = results.provenance().get("inputs") or {}
    names = [name for name, content in planned.inputs.items() if earlier.get(name, content) != content]
    told = (
        "changed since the folder of results was last used, so that only results of the present content count"
    )
    return (f"{told}: {listed(names)}",) if names else ()
