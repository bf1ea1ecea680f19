"""`graspsense collect` with an operator whose answers are written down."""

import json
from collections import Counter

import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed, refused
from grippers import Scripted, bottle, settings_with, squeezing
from kept import BENCH, keep

from graspsense.core.components.registry import installed
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError
from graspsense.store.collecting import Collection, Wanted
from graspsense.store.comparable import check_settings, newest_grasp
from graspsense.store.store import Store

PLAIN = ("-o", "classifier.type=none")
COARSE = ("-o", "gripper.sensor=ideal", "-o", "gripper.rate_hz=250")
"""Settings with which a simulated grasp takes a fraction of the time."""
EMULATED = ("--gripper", "pr2", "-o", "gripper.transport=emulated")


def collect(folder, answers, labels="can:full_open,block", each=2, more=COARSE):
    command = ("collect", "--labels", labels, "--each", each, "--save", folder, *PLAIN, *more)
    return graspsense(*command, "--json", answers=answers)


def trials_in(folder):
    with Store.read(folder) as store:
        return [
            (summary.id, summary.label, summary.set_aside) for summary in reversed(store.page(set_aside=None))
        ]


@pytest.fixture
def grasped(tmp_path):
    """The folder of a store with a trial of the simulated gripper and the settings of the pipeline default."""
    with Store.open(tmp_path / "grasped") as store:
        keep(store, device=evolve(BENCH, name="simulated PR2 gripper", serial=""))
    return tmp_path / "grasped"


@pytest.mark.slow
def test_it_prompts_counts_undoes_retakes_and_stops_when_everything_is_there(tmp_path):
    done = collect(tmp_path / "t", "\nu\n\n\n?\nr\n\n\n")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["counts"] == {"can:full_open": 2, "block": 2}
    assert result["complete"]
    assert result["sets"]["unit"] == "trials"
    assert all(9 - result["counts"][label] == n for label, n in result["sets"]["lacking"].items())
    kept = trials_in(tmp_path / "t")
    assert [number for number, _, _ in kept] == result["trials"] == [1, 2, 3, 4, 5, 6]
    assert kept[0][2] == "undone by the operator"
    assert [why for _, _, why in kept].count("repeated by the operator") == 1
    assert Counter(label for _, label, why in kept if why is None) == {"can:full_open": 2, "block": 2}
    assert done.stderr.startswith("keys: Enter grasps it, u undoes")
    assert done.stderr.count("keys: ") == 2
    assert "next: block  (1 of 2)" in done.stderr


@pytest.mark.slow
def test_an_emulated_pr2_grasps_what_the_label_says_and_its_fault_is_told_with_the_trial(tmp_path):
    frozen = (*EMULATED, "-o", "gripper.faults.freeze_cell=15")
    done = collect(tmp_path / "t", "\n\n", labels="block,can:full_open#2", each=1, more=frozen)

    assert done.returncode == 0, done.stderr
    assert sorted(held(tmp_path / "t")) == [
        ("block", "block", True),
        ("can:full_open", "can:full_open#2", True),
    ]
    told = [line for line in done.stderr.splitlines() if "frozen cells" in line]
    assert len(told) == 2
    assert "warning" in told[0]
    with Store.read(tmp_path / "t") as store:
        assert "(15)" in store.trial(1).result.details["warnings"][0]


@pytest.mark.slow
def test_classes_come_in_rounds_so_that_none_is_recorded_in_one_go(tmp_path):
    collect(tmp_path / "t", "\n" * 6, labels="block,none,can:full_open", each=2)
    labels = [label for _, label, _ in trials_in(tmp_path / "t")]
    for k in (0, 3):
        assert sorted(labels[k : k + 3]) == ["block", "can:full_open", "none"]


@pytest.mark.slow
def test_it_goes_on_where_it_was_with_new_draws(tmp_path):
    session = json.loads(collect(tmp_path / "t", "\n\nq\n").stdout)
    assert not session["complete"]
    continued = json.loads(collect(tmp_path / "t", "\n\n\n\n").stdout)
    assert continued["trials"] == [3, 4]
    assert continued["complete"]
    with Store.read(tmp_path / "t") as store:
        values = [store.trial(number).result.features.values for number in (1, 2, 3, 4)]
        seeds = [store.trial(number).record.provenance["seed"] for number in (1, 2, 3, 4)]
    assert len(set(values)) == 4
    assert seeds == [0, 1, 2, 3]


RUN = ("run", "--label", "block", *PLAIN, "--save")


@every_case("command", [RUN, ("collect", "--labels", "block,can:full_open", *PLAIN, "--save")])
@every_case(
    ("options", "says"),
    [
        (("-o", "controller.probing_force_n=12"), "controller.probing_force_n was 20.0 and is 12.0"),
        (("-o", "features.force=left"), "features.force was 'mean' and is 'left'"),
        (EMULATED, "gripper.type was 'graspsense-sim-gripper/sim' and is 'graspsense-pr2-gripper/pr2'"),
    ],
)
def test_other_settings_are_refused_before_the_grasp(grasped, command, options, says):
    err = refused(*command, grasped, *options, answers="\n")
    assert says in err
    assert "add --changed if" in err
    assert len(trials_in(grasped)) == 1


@pytest.mark.slow
def test_other_settings_are_taken_if_it_is_told(grasped):
    changed = (*COARSE, "-o", "controller.probing_force_n=12", "--changed")
    assert collect(grasped, "\nq\n", more=changed).returncode == 0
    printed(*RUN, grasped, *changed)
    assert len(trials_in(grasped)) == 3
    # Another classifier is no other setting.
    command = ("collect", "--labels", "block,can:full_open", "--save", grasped, *changed[:-1])
    printed(*command, "-o", "classifier.type=knn", answers="q\n")


@pytest.mark.slow
def test_another_gripper_is_refused_before_it_moves(tmp_path):
    class Serial(Scripted):
        commanded = 0

        def open(self, seed):
            return evolve(super().open(seed), serial="B")

        def apply(self, command):
            type(self).commanded += 1
            super().apply(command)

    def settings_for(word, seed):
        return settings_with(lambda: Serial(squeezing, bottle), f"run.seed={seed}")

    answers = iter(["", "", "q"])
    with Store.open(tmp_path / "t") as store:
        keep(store, label="jar:full", device=evolve(BENCH, name="scripted", serial="A"))
        collection = Collection(
            store=store,
            wanted=Wanted(words=("jar:full",), each=5),
            plugins=installed(),
            settings_for=settings_for,
            ask=lambda question: next(answers),
            say=lambda text: None,
        )
        with pytest.raises(ConfigError, match="serial was 'A' and is 'B'"):
            collection.run()
        assert Serial.commanded == 0
        assert collection.counts() == {"jar:full": 1}
        assert list(store.recordings.glob("*.part")) == []
        collection.changed = True
        collection.run()
        assert collection.counts() == {"jar:full": 2}


def test_what_somebody_else_collects_meanwhile_is_not_collected_again(tmp_path):
    settings = settings_with(lambda: Scripted(squeezing, bottle))
    with Store.open(tmp_path / "t") as store:

        def ask(question):
            keep(store, label="jar:full")  # by another program, while this one waits for its operator
            return ""

        collection = Collection(
            store=store,
            wanted=Wanted(words=("jar:full",), each=1),
            plugins=installed(),
            settings_for=lambda word, seed: settings,
            ask=ask,
            say=lambda text: None,
        )
        collection.run()
        assert collection.counts() == {"jar:full": 1}
        assert collection.collected == {}


@pytest.mark.slow
def test_without_a_folder_it_is_trials_and_what_is_there_is_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = graspsense("collect", "--labels", "block", "--each", "1", *PLAIN, *COARSE, answers="\n")
    assert done.returncode == 0, done.stderr
    assert "next: block  (1 of 1)" in done.stderr
    counts, sets = done.stdout.splitlines()[:2]
    assert counts.split() == ["block", "1", "of", "1"]
    assert sets.endswith(": block 8")
    assert trials_in(tmp_path / "trials") == [(1, "block", None)]


def test_nothing_there_counts_since_it_is_an_answer_of_the_gripper(tmp_path):
    done = collect(tmp_path / "t", "\n", labels="none", each=1)
    assert json.loads(done.stdout)["counts"] == {"none": 1}


@pytest.mark.slow
def test_the_first_trials_are_collected_for_a_model_that_does_not_exist_yet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(
        'extends = "default"\n[classifier]\ntype = "knn"\nmodel = "mine.json"\n'
    )
    collect_both = ("collect", "--pipeline", "mine.toml", "--labels", "can:full_open,can:empty_open")
    note = "note: `collect` works with it, `run` does not yet: there is no model mine.json yet"
    assert note in printed("config", "validate", "mine.toml")
    done = graspsense(*collect_both, "--each", "2", "--save", "t", *COARSE, answers="\n" * 4)
    assert done.returncode == 0
    assert "model mine.json yet" in done.stderr
    with Store.read(tmp_path / "t") as store:
        assert sum(store.counts("collect").values()) == 4

    printed("train", "store:t", "--classifier", "knn", "--out", "mine.json")
    assert "note" not in printed("config", "validate", "mine.toml")


def test_the_advice_on_a_missing_model_fits_the_gripper():
    model = ("-o", "classifier.type=knn", "-o", "classifier.model=mine.json")
    err = refused("run", "--gripper", "pr2", *model)
    assert "graspsense collect --gripper pr2 --labels" in err
    assert "graspsense train store:trials --classifier knn --out mine.json" in err
    assert "simulated" not in err


def held(folder):
    """Return label, object and whether it is simulated of each trial, in their order."""
    with Store.read(folder) as store:
        trials = [store.trial(summary.id) for summary in reversed(store.page())]
    objects = [trial.record.settings["gripper"]["object"] for trial in trials]
    return [(t.summary.label, held, t.summary.simulated) for t, held in zip(trials, objects, strict=True)]


TOY = (("--object", "toy"), ("-o", "gripper.object=toy"))


@every_case(
    ("labels", "more", "says"),
    [
        (",", (), "nothing to collect"),
        ("block,block", (), "named twice"),
        *((f"block,{label}", (), f"{label!r} is not a label") for label in ("my can:full", "can:full open", "can#2 b")),
        # An object that the gripper does not know, and one that contradicts the label.
        ("block,nonsense:full", (), "named 'nonsense'"),
        *((f"block,{label}", (), "object 'can'") for label in ("can", "can:full_opn")),
        *(("block", (*gripper, *toy), "the object toy")
          for gripper in ((), EMULATED) for toy in TOY),
    ],
)  # fmt: skip
def test_labels_that_make_no_sense_are_refused_before_the_store_exists(tmp_path, labels, more, says):
    done = collect(tmp_path / "t", "\n\n", labels=labels, more=more)
    assert done.returncode == 2
    assert says in done.stderr
    assert "next:" not in done.stderr
    assert not (tmp_path / "t").exists()


@pytest.mark.slow
def test_an_object_from_a_file_can_have_any_label(tmp_path):
    scene = tmp_path / "mine.toml"
    scene.write_text('width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 5000.0\n')

    done = collect(tmp_path / "t", "\n", labels="sponge:dry", each=1, more=("--object", str(scene)))

    assert done.returncode == 0, done.stderr
    assert held(tmp_path / "t") == [("sponge:dry", str(scene), True)]


@pytest.mark.slow
def test_what_is_grasped_and_what_changes_no_result_may_differ(grasped):
    options = ("--seed", "3", "-o", "gripper.explain=true", "-o", "gripper.compile=never")
    printed("run", "--label", "can:empty_open", *PLAIN, *options, "--save", grasped)
    assert collect(grasped, "q\n", more=()).returncode == 0


def test_a_setting_that_is_newer_than_the_trial_had_its_default(grasped):
    with Store.read(grasped) as store:
        default_grasp = newest_grasp(store)
        check_settings(store, default_grasp, resolve("default"))
        with pytest.raises(ConfigError, match=r"controller\.ramp_s was 0\.0 and is 0\.1"):
            check_settings(store, default_grasp, resolve("default", options=["controller.ramp_s=0.1"]))


@pytest.mark.slow
def test_a_store_and_files_with_spaces_in_their_names_work_everywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my lab.toml").write_text('extends = "default"\n[classifier]\ntype = "none"\n')
    pipeline, store = ("--pipeline", "my lab.toml"), "my trials"
    # Other tests name the folder of a store; its database names it as well.
    named = f"{store}/store.sqlite"

    command = ("collect", *pipeline, *COARSE, "--labels", "block,none", "--each", "2")
    command += ("--operator", "A B", "--save", store)
    printed(*command, answers="\n" * 4)
    for command in (
        ("trials", "list", named),
        ("trials", "aside", f"{store}#1", "--why", "moved by hand"),
        ("replay", f"{store}#2"),
        ("verify", named),
        ("recover", named),
        ("export", named, "--to", "my table.csv"),
        ("export", f"{store}#2", "--to", "one grasp.csv"),
        ("evaluate", named, "--folds", "2"),
        ("compare", named, "--folds", "2", "--classifiers", "c45,tree"),
        ("train", f"store:{store}", "--out", "my model.json"),
        ("train", named, "--out", "model.json"),
        ("predict", "my model.json", named),
        ("predict", "my model.json", "my table.csv"),
        ("run", "-o", "classifier.type=c45", "-o", "classifier.model=my model.json"),
        ("report", named, "--folds", "2"),
    ):
        printed(*command)
