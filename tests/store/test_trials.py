"""Labels of stored trials are changed, and trials are set aside and brought back, with a history that is kept."""

import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed, refused
from kept import BENCH, keep

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.report.store_page import store_page
from graspsense.sources.squeezes import recorded_squeezes
from graspsense.store import changes
from graspsense.store.dataset import labelled_store
from graspsense.store.export_table import trial_table
from graspsense.store.labels import labels_of
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

REAL = evolve(BENCH, simulated=False)


@pytest.fixture
def store(tmp_path):
    with Store.open(tmp_path / "my trials") as store:
        yield store


def labels(store):
    return [(summary.id, summary.label, summary.instance) for summary in reversed(store.page(set_aside=None))]


def changed(store, command, *numbers_and_words):
    """Run `graspsense trials COMMAND` on the trials of these numbers, with the words behind them."""
    refs = [f"{store.folder}#{word}" if isinstance(word, int) else word for word in numbers_and_words]
    return graspsense("trials", command, *refs)


def test_a_relabelled_trial_has_its_new_label_everywhere_and_the_store_is_intact(store):
    for _ in range(2):
        keep(store, "can:full_open", "can#2", device=REAL)
    keep(store, "toy", device=REAL)

    code, out, _ = changed(store, "relabel", 2, "--label", "can:empty_open#3", "--why", "was empty")

    assert (code, out) == (0, "trial 2: relabelled from can:full_open#2 to can:empty_open#3 (was empty)\n")
    assert labels(store)[1] == (2, "can:empty_open", "can#3")
    assert store.trial(2).record.labels == {"label": "can:empty_open", "instance": "can#3"}
    assert labelled_store(str(store.folder)).labels == ("can:full_open", "can:empty_open", "toy")
    (squeeze,) = recorded_squeezes([f"store:{store.folder}"], "can:empty_open")
    assert (squeeze.name, squeeze.instance) == (f"{store.folder}#2", "can#3")
    assert any("labels of 1 trial" in note for note in labelled_store(str(store.folder)).notes)
    assert store.counts() == {("can:full_open", "can#2"): 1, ("can:empty_open", "can#3"): 1, ("toy", None): 1}
    assert verify_store(store.folder).problems == ()
    code, out, _ = graspsense("trials", "list", store.folder)
    assert "can:full_open#2 to can:empty_open#3" in out
    page = store_page(str(store.folder)).html()
    assert "can:full_open#2 to can:empty_open#3" in page
    assert "was empty" in page


def test_a_label_is_restored_as_it_was_recorded_also_none(store):
    keep(store, "can:full_open", "can#2", device=REAL)
    keep(store, None, device=REAL)
    records = [store.trial(number).record for number in (1, 2)]

    for words in (("--label", "toy"), ("--label", "can:empty_open#9"), ("--as-recorded",)):
        assert changed(store, "relabel", 1, 2, *words).returncode == 0

    assert [store.trial(number).record for number in (1, 2)] == records
    assert [(change.old, change.new) for change in changes.history(store, 2)] == [
        (None, "toy"),
        ("toy", "can:empty_open#9"),
        ("can:empty_open#9", None),
    ]
    assert verify_store(store.folder).problems == ()


def test_trials_that_are_set_aside_are_not_used_until_they_are_brought_back(store, tmp_path):
    for grasp, label in enumerate(("can:full_open", "can:empty_open") * 3):
        keep(store, label, grasp=grasp)
    assert changed(store, "aside", 1, 4, "--why", "the bench was moved").returncode == 0

    # Trials 2, 3, 5 and 6 of the alternating labels.
    left = ("can:empty_open", "can:full_open", "can:full_open", "can:empty_open")
    assert labelled_store(str(store.folder)).labels == left
    assert any("2 set aside" in note for note in labelled_store(str(store.folder)).notes)
    for command in ("train", "evaluate"):
        out = ["--out", str(tmp_path / "m.json")] if command == "train" else ["--folds", "2"]
        assert "2 set aside" in "".join(map(str, graspsense(command, f"store:{store.folder}", *out)))
    assert "out: 2" in printed("export", store.folder, "--to", tmp_path / "a.csv")
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 5
    listed = json.loads(graspsense("trials", "list", store.folder, "--aside", "--json")[1])
    assert [load["id"] for load in listed] == [4, 1]
    assert {load["set_aside"] for load in listed} == {"the bench was moved"}

    assert changed(store, "restore", 1, 4, "--why", "it was not").returncode == 0

    assert labelled_store(str(store.folder)).labels == ("can:full_open", "can:empty_open") * 3
    history = json.loads(graspsense("trials", "history", store.folder, "--json")[1])
    assert [(load["trial"], load["action"], load["why"]) for load in history] == [
        (1, "aside", "the bench was moved"),
        (4, "aside", "the bench was moved"),
        (1, "restore", "it was not"),
        (4, "restore", "it was not"),
    ]
    assert verify_store(store.folder).problems == ()


@every_case(
    ("command", "says"),
    [
        (("aside", 1, 9, "--why", "x"), "trial 9.* 1 to 3"),
        (("aside", 1, 2, "--why", "x"), "trial 2 .*already: earlier"),
        (("restore", 2, 1), "trial 1 is not"),
        (("relabel", 2, 1, "--label", "toy"), "trial 1 .*label toy"),
        (("relabel", 1, "--label", "my toy"), "'my toy'"),
        (("relabel", 1), "give either --label CLASS:STATE or --as-recorded"),
        (("aside", 1, "--why", " "), "'--why': it is empty"),
        (("aside", "1", "--why", "x"), "write DIR#NUMBER"),
        (("aside", "typo#1", "--why", "x"), "no store in"),
        (("relabel", 3, "--label", "block"), "trial 3 .*can:full_open.*block"),
    ],
)
def test_a_change_that_is_wrong_for_one_trial_changes_none(tmp_path, command, says):
    with Store.open(tmp_path / "my trials") as store:
        keep(store, "toy", device=REAL)
        keep(store, "block", device=REAL)
        keep(store, "can:empty_open")  # simulated with can:full_open
        changes.set_aside(store, [2], "earlier")
        state = (labels(store), changes.history(store))

        code, _, err = changed(store, *command)

        assert code == 2
        assert re.search(says, " ".join(err.split()))
        assert (labels(store), changes.history(store)) == state


KILLED = """
import sys, time
from contextlib import contextmanager
from graspsense.store import changes
from graspsense.store.store import Store

store = Store.open(sys.argv[1])
whole = store.transaction

@contextmanager
def slow():
    with whole() as connection:
        yield connection
        print("before the commit", flush=True)
        sys.stdin.read()

store.transaction = slow
changes.relabel(store, [1, 2], {"label": "block"}, "killed")
"""


@pytest.mark.slow
def test_a_process_that_is_killed_within_a_change_leaves_the_store_as_it_was(store):
    keep(store, "toy", device=REAL)
    keep(store, "toy", device=REAL)

    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(store.folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "before the commit\n"
        os.kill(process.pid, signal.SIGKILL)

    assert [label for _, label, _ in labels(store)] == ["toy", "toy"]
    assert changes.history(store) == []
    assert verify_store(store.folder).problems == ()
    changes.relabel(store, [1], labels_of("block"), "again")
    assert [label for _, label, _ in labels(store)] == ["block", "toy"]


def test_verify_finds_a_label_or_a_state_that_no_change_explains(store):
    keep(store, "toy", device=REAL)
    changes.relabel(store, [1], labels_of("block"), "")
    for statement, says in (
        (
            "UPDATE trial SET set_aside = 'x'",
            "its history does not say that it was set aside or brought back",
        ),
        ("UPDATE trial SET set_aside = NULL", None),
        ("UPDATE change SET \"after\" = 'ball'", "its label is not the one of its history (ball)"),
        ("DELETE FROM change", "its label is not the one of its history (toy)"),
    ):
        store._connection.execute(statement)
        assert verify_store(store.folder).problems == ((f"trial 1: {says}",) if says else ())
    # A row that somebody else changed is not made valid by a new label.
    store._connection.execute("UPDATE trial SET outcome = 'slipped'")
    with pytest.raises(DataDamaged, match=r"my trials .*trial 1 "):
        changes.relabel(store, [1], labels_of("ball"), "")


def test_a_store_of_the_first_version_keeps_what_was_set_aside_in_it(store):
    for _ in range(2):
        keep(store)
    store.close()
    with closing(sqlite3.connect(store.folder / "store.sqlite")) as connection:
        connection.executescript(
            "DROP TABLE change; UPDATE trial SET set_aside = 'undone' WHERE id = 1; PRAGMA user_version = 1"
        )
    content = (store.folder / "store.sqlite").read_bytes()
    with Store.read(store.folder) as old:
        (change,) = changes.history(old)
        assert (change.trial, change.words, change.why) == (1, "set aside", "undone")
        assert [old.trial(trial.id).result.features.values for trial in old.page()] == [(0.066, 5.5)]
        assert (store.folder / "store.sqlite").read_bytes() == content  # it may be on a read-only disk
        changes.set_aside(store := Store.open(old.folder), [2], "x")
        store.close()
    assert verify_store(store.folder).problems == ()
    with pytest.raises(ConfigError, match=r"my trials .*\(2 "):
        trial_table(store.folder)


def test_a_store_that_is_rebuilt_from_its_recordings_says_that_its_changes_are_lost(store):
    keep(store, "toy", device=REAL)
    keep(store, "toy", device=REAL)
    changes.relabel(store, [1], labels_of("block"), "")
    changes.set_aside(store, [2], "x")
    store.close()
    for path in store.folder.glob("store.sqlite*"):
        path.unlink()

    code, _, err = graspsense("recover", store.folder)

    assert code == 0
    assert "as recorded" in err
    with Store.read(store.folder) as rebuilt:
        assert labels(rebuilt) == [(1, "toy", None), (2, "toy", None)]
    assert "as recorded" not in graspsense("recover", store.folder)[2]


def test_a_number_is_changed_given_and_restored(store):
    for cell in ("200", "210"):
        keep(store, device=REAL, labels={"fill [ml]": cell})
    keep(store, device=REAL)
    folder = str(store.folder)

    code, out, _ = changed(store, "value", 1, 3, "--value", "fill [ml]=250", "--why", "scale")

    assert code == 0
    assert all(part in out for part in ("trial 1: number changed", "fill [ml]=200 to fill [ml]=250 (scale)"))
    assert all(part in out for part in ("trial 3: number changed", "fill [ml]=250 (scale)"))
    trials = labelled_store(folder, value="fill")
    assert (trials.value.unit, trials.value.values) == ("ml", (250.0, 210.0, 250.0))
    assert any("numbers of 2 trials" in note for note in trials.notes)
    assert trial_table(folder).further.values[:, -1].tolist() == [250.0, 210.0, 250.0]
    assert verify_store(store.folder).problems == ()
    # What was recorded stays, and comes back.
    assert store.trial(1).record.labels["fill [ml]"] == "200"
    assert changed(store, "value", 1, 3, "--as-recorded", "fill").returncode == 0
    assert labelled_store(folder, value="fill").value.values == (200.0, 210.0)
    assert [change.action for change in changes.history(store)] == ["value"] * 4


def test_a_number_that_cannot_be_changed_is_refused(store):
    for _ in range(2):
        keep(store, device=REAL, labels={"fill [ml]": "200"})
    for given, says in (
        (("--value", "fill [l]=0.2"), r"fill of other trials is in ml, .* write fill \[ml\]=NUMBER"),
        (("--value", "fill [ml]=200"), r"trial 1 has fill \[ml\]=200 already"),
        (("--value", "fill [ml]"), r"write NAME \[UNIT\]=NUMBER"),
        (("--as-recorded", "weight"), "no number 'weight' already"),
        ((), "give either --value"),
    ):
        code, _, err = changed(store, "value", 1, *given)
        assert code == 2
        assert re.search(says, " ".join(err.split()))
        assert changes.history(store) == []
    store._connection.execute("DELETE FROM detail WHERE trial = 2")
    with pytest.raises(DataDamaged, match="trial 2"):
        changes.set_number(store, [1, 2], "fill [ml]", "210", "")
    assert changes.history(store) == []
    # Nor are trials collected with a number in another unit.
    collect = ("collect", "--save", store.folder, "--labels", "can:full_open", "--value", "fill=3")
    assert "ml, and 'fill'" in " ".join(refused(*collect).split())


@pytest.mark.slow
def test_the_page_of_a_store_has_a_section_for_a_number(store, tmp_path):
    for k in range(24):
        fill = 100.0 + 5.0 * k
        keep(store, "can:full_open", f"can#{k % 12}", device=REAL, ticks=3, values=(0.066, fill / 20.0), grasp=k,
             labels={"fill [ml]": repr(fill)})  # fmt: skip

    printed("report", store.folder, "--out", tmp_path / "page", "--target-value", "fill", "--folds", "3")
    page = (tmp_path / "page" / "report.html").read_text()
    assert "Predicted number: fill" in page
    assert "absolute error" in page
    assert page.count("predicted ") >= 24  # a mark with its words for each trial
    for control in ("mean only", "width only"):
        assert control in page
    err = refused("report", store.folder, "--out", tmp_path / "page", "--target-value", "weight")
    assert "of the store" in err
    assert "There are: fill" in " ".join(err.split())
