"""Running an experiment: the missing tasks are run, and each result is stored at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from attrs import field, frozen

from graspsense.core.errors import ConfigError
from graspsense.core.interrupts import Interrupts
from graspsense.experiments.executors.base import Executor, ExecutorLost
from graspsense.experiments.experiment import Planned
from graspsense.experiments.results import Results
from graspsense.experiments.task import TaskResult
from graspsense.experiments.timing import TimeLeft
from graspsense.experiments.versions import differences, versions
from graspsense.recording.atomic_file import SaveFailed

STORE_FILE = "store.sqlite"
"""The file by which a folder is a store of trials; this room does not know the store itself."""


@frozen(kw_only=True)
class Account:
    """What came of a run: of `total` tasks so many were `kept` from before, `done`, and `failed`; the rest is missing.

    `stopped` says why the run ended before its end, where it did.
    """

    total: int
    kept: int
    done: int
    failed: tuple[TaskResult, ...] = ()
    stopped: str = ""
    notes: tuple[str, ...] = field(default=())

    @property
    def missing(self) -> int:
        """Tasks without a result."""
        return self.total - self.kept - self.done - len(self.failed)

    @property
    def complete(self) -> bool:
        """Whether every task has a result."""
        return self.kept + self.done == self.total

    @property
    def words(self) -> str:
        """The account in a sentence."""
        parts = [f"{self.done} done now"]
        if self.kept:
            parts.append(f"{self.kept} kept from before")
        if self.failed:
            parts.append(f"{len(self.failed)} failed")
        if self.missing:
            parts.append(f"{self.missing} not done")
        return f"{self.total} tasks: {', '.join(parts)}"


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

    `executor` is asked for only where something is missing. Ctrl-C, the workers' end and a disk that takes no
    further result stop the run; what was done until then is kept. Raises ConfigError where there are results
    already and `resume` is not set, SaveFailed where nothing can be written to begin with.
    """
    tasks = list({task.key: task for task in planned.tasks()}.values())
    if (results.folder / STORE_FILE).exists():
        raise ConfigError(
            f"{results.folder} is a store of trials, and the page of an experiment would replace its own: name another "
            "folder by --out"
        )
    with results.alone():
        if results.any() and not resume:
            raise ConfigError(
                f"there are results in {results.folder} already. --resume does what is missing there; "
                "another --out begins anew"
            )
        known = {
            key: one for key, one in results.of([task.key for task in tasks]).items() if one.state == "done"
        }
        results.begin(planned, command)
        notes = _notes(list(known.values()))
        todo = [task for task in tasks if task.key not in known]
        came: list[str] = []
        failures = 0
        stopped = ""
        if todo:
            running: Executor | None = None
            left = TimeLeft(len(todo))
            try:
                with Interrupts():
                    running = executor()
                    left.workers = running.workers
                    for done in running.run(todo):
                        came.append(done.key)
                        results.add(done)
                        left.add(done.seconds)
                        if done.state == "failed":
                            failures += 1
                            if said is not None:
                                said(f"{done.name} failed: {done.reason}")
                        if progress is not None:
                            what = f"tasks, {left.words}" + (f", {failures} failed" if failures else "")
                            progress(what, len(known) + len(came), len(tasks))
            except KeyboardInterrupt:
                stopped = "interrupted"
            except (ExecutorLost, SaveFailed) as lost:
                stopped = str(lost)
            finally:
                if running is not None:
                    running.close()
        # Counted on the disk: an interrupt may fall while a result is being kept.
        new = results.of(came).values()
    return Account(
        total=len(tasks),
        kept=len(known),
        done=sum(one.state == "done" for one in new),
        failed=tuple(one for one in new if one.state == "failed"),
        stopped=stopped,
        notes=tuple(notes),
    )


def _notes(known: Sequence[TaskResult]) -> list[str]:
    """Return the differences between the versions of the existing results and those of this process."""
    found: list[str] = []
    for one in known:
        for line in differences(versions(), one.made.get("versions", {})):
            text = f"results from before were made with other versions: {line}"
            if text not in found:
                found.append(text)
    return found
