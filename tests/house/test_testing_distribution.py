"""The kit's checks of a whole distribution: each catches one that is broken in just that way."""

import json
import zipfile
from functools import partial

import pytest

from graspsense.core.components.registry import HEAVY
from graspsense.testing import CHECKS, package
from graspsense.testing.checks import outcome_of
from graspsense.testing.conformance import checks_for
from graspsense.testing.subject import package_of

HEAD = """
    from graspsense.plugin_api import DatasetEntry, Feature, FeatureSetEntry, PipelineEntry, hookimpl
    GRASPSENSE_API = (2, 0)
"""

SOUND = (
    HEAD
    + """
    @hookimpl
    def graspsense_feature_sets():
        peak = Feature("peak", "N", "largest force")
        yield FeatureSetEntry("summit", "parts:Peak", "peak", requires=(), features=(peak,))

    @hookimpl
    def graspsense_run_finished(run, trial):
        run.labels.get("object")

    @hookimpl
    def graspsense_probe_devices(timeout_s):
        return []

    @hookimpl
    def graspsense_pipelines():
        yield PipelineEntry("lab", "lab_pipes:lab.toml", "a recording")

    @hookimpl
    def graspsense_datasets():
        yield DatasetEntry(name="lab-data", recordings="lab_reader:recordings", summary="grasps")

    @hookimpl(optionalhook=True)
    def graspsense_lab_parts():
        return [1, 2, 3]
"""
)

READER = """
    from functools import partial
    from pathlib import Path
    import numpy as np
    from graspsense.plugin_api import GraspColumns, LabelledRecording, checked_recording, each_readable

    def recordings(folder):
        for path in sorted(Path(folder).glob("*.csv")):
            yield from each_readable(path.name, partial(grasps_in, path))

    def grasps_in(path):
        t_s, gap_m, left_n, right_n = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
        columns = GraspColumns(source=path.name, t_s=t_s, gap_m=gap_m, left_n=left_n, right_n=right_n)
        yield LabelledRecording(recording=checked_recording(columns), source=path.name, label="jar:full")
"""

PIPELINE = """
    [gripper]
    type = "replay"
    recording = "csv:somewhere.csv"
    [controller]
    type = "hybrid"
    [features]
    type = "{features}"
    [classifier]
    type = "none"
"""


def check(site, name, plugin=SOUND, features="chitta", reader=READER):
    site.install("lab-thing", plugin, lab_reader=reader)
    examples = site.folder / "examples"
    examples.mkdir()
    for k in range(2):
        rows = [f"{t / 100},{0.06 - t / 9000},{t / 50},{t / 40}" for t in range(100)]
        (examples / f"jar_{k}.csv").write_text("\n".join(["seconds,opening,thumb,index", *rows, ""]))
    (site.folder / "lab_pipes").mkdir()
    (site.folder / "lab_pipes" / "__init__.py").touch()
    (site.folder / "lab_pipes" / "lab.toml").write_text(PIPELINE.format(features=features))
    site.modules.append("lab_pipes")
    package = package_of("lab-thing", site.discover(), data={"lab-data": str(examples)})
    (chosen,) = [check for check in CHECKS["distribution"] if check.id == name]
    return outcome_of(chosen, package, {})


@pytest.mark.parametrize("name", [sound.id for sound in CHECKS["distribution"]])
def test_a_sound_distribution_passes(site, name):
    result = check(site, name)

    assert (result.state, result.text) == ("passed", "")


WATCHING = """
    from graspsense.gripper_api import LiveObserverEntry

    @hookimpl
    def graspsense_live_observers():
        yield LiveObserverEntry("lab-wall", "lab_wall:observe", "a wall of screens")
"""
MEASURING = """
    from graspsense.experiment_api import ExperimentKindEntry

    @hookimpl
    def graspsense_experiment_kinds():
        classes = {"keys": "parts:HandConfig", "result": "parts:HandConfig"}
        yield ExperimentKindEntry(name="wear", summary="wear", run="parts:Peak", **classes)
"""
OBSERVING = 'run.labels.get("object")'
READING = 'np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)'
LENIENT = 'np.genfromtxt(path, delimiter=",", skip_header=1, unpack=True)'
UNCHANGED, NAMED = "observers-change-nothing", "reader-errors-name-file-and-column"


def changed(sound, part, other):
    """Return the sound source with another part, as what `check` takes."""
    assert part in sound
    return {"reader" if sound is READER else "plugin": sound.replace(part, other)}


MUTANTS = [
    ("plugins-load", {"plugin": HEAD + "    import no_such_driver"}, "'no_such_driver'"),
    ("plugin-modules-are-light", {"plugin": HEAD + "    import numpy"}, "imports numpy"),
    ("everything-declared-loads", {"plugin": SOUND + WATCHING}, "'lab_wall'"),
    ("everything-declared-loads", {"plugin": SOUND + MEASURING}, "has no source and no simulated"),
    ("names-are-unique", changed(SOUND, '"summit"', '"chitta"'), "'chitta' is taken by graspsense/chitta"),
    (UNCHANGED, changed(SOUND, OBSERVING, 'run.labels["object"] = "mine"'), "changed its arguments"),
    (UNCHANGED, changed(SOUND, OBSERVING, "trial.trace.force_left_n[:] = 0.0"), "changed its arguments"),
    (UNCHANGED, changed(SOUND, OBSERVING, "run.nothing"), "catch what may go wrong"),
    (UNCHANGED, changed(SOUND, OBSERVING, "return 1"), "an observer returns nothing"),
    ("probe-returns-in-time", changed(SOUND, "return []", "raise OSError('no bus')"), "OSError: no bus"),
    ("pipelines-fit-together", {"features": "chita"}, "no feature set named 'chita'"),
    (
        "readers-read-the-same-twice",
        changed(READER, '"jar:full"', "str(np.random.random())"),
        "other recordings",
    ),
    ("readers-read-the-same-twice", changed(READER, READING, f"{READING}[:3]"), "cannot read: jar_0.csv"),
    (
        NAMED,
        changed(READER, READING, f"{LENIENT[:-1]}, filling_values=0.0)"),
        "does not name file and column",
    ),
    (
        NAMED,
        changed(
            READER,
            READING,
            f"[np.nan_to_num(c) if k else np.arange(len(c)) for k, c in enumerate({LENIENT})]",
        ),
        "is no error",
    ),
    (
        NAMED,
        changed(
            READER, "    t_s, gap", "    if not path.stat().st_size:\n            return\n        t_s, gap"
        ),
        "an empty jar_0.csv is no error",
    ),
]


@pytest.mark.parametrize(
    ("name", "changes", "says"),
    [pytest.param(*mutant, marks=pytest.mark.slow if "light" in mutant[0] else ()) for mutant in MUTANTS],
)
def test_a_check_catches_its_mutant(site, name, changes, says):
    result = check(site, name, **changes)

    assert result.state == "failed"
    assert says in result.text


OWNER = """
    from graspsense.plugin_api import hookimpl
    from graspsense.simulator_api import ConformanceCheckEntry
    GRASPSENSE_API = (2, 0)

    @hookimpl
    def graspsense_conformance_checks():
        yield ConformanceCheckEntry("parts-are-few", "lab_owner_checks:few", "graspsense_lab_parts", "few parts")
"""
FEW = """
    def few(results):
        for parts in results:
            if len(parts) > {most}:
                yield f"{{len(parts)}} parts: give {most} at most"
"""


@pytest.mark.parametrize(
    ("most", "state", "text"), [(3, "passed", ""), (2, "failed", "3 parts: give 2 at most")]
)
def test_the_owner_of_a_hook_contributes_checks_of_it(site, most, state, text):
    site.install("lab-owner", OWNER, lab_owner_checks=FEW.format(most=most))
    site.install("lab-thing", SOUND)
    plugins = site.discover()

    (check,) = [
        check for check in checks_for(package_of("lab-thing", plugins)) if check.id == "parts-are-few"
    ]
    result = outcome_of(check, package_of("lab-thing", plugins), {})

    assert (result.title, result.state, result.text) == ("few parts", state, text)
    assert all(check.id != "parts-are-few" for check in checks_for(package_of("lab-owner", plugins)))


def test_every_check_of_a_distribution_has_a_mutant():
    caught = {name for name, *_ in MUTANTS}
    assert {check.id for check in CHECKS["distribution"]} == caught | {"wheel-is-complete"}
    assert "numpy" in HEAVY


@pytest.mark.slow
def test_what_is_missing_from_the_wheel_is_named(site, tmp_path, monkeypatch):
    folder = tmp_path / "project"
    (folder / "packed_thing").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "packed-thing"\nversion = "0.2"\n'
        '[tool.hatch.build.targets.wheel]\npackages = ["packed_thing"]\n'
    )
    plugin = """
from graspsense.plugin_api import Feature, FeatureSetEntry, PipelineEntry, hookimpl
GRASPSENSE_API = (2, 0)
@hookimpl
def graspsense_feature_sets():
    peak = Feature("peak", "N", "largest force")
    yield FeatureSetEntry(
        "summit", "packed_thing.features:Peak", "peak", requires=(), features=(peak,)
    )
@hookimpl
def graspsense_pipelines():
    yield PipelineEntry("lab", "packed_thing:lab.toml", "ours")
"""
    contents = {"__init__.py": "", "plugin.py": plugin, "features.py": "", "lab.toml": "", "table.csv": "1"}
    for name, text in contents.items():
        (folder / "packed_thing" / name).write_text(text)
    site.patch.syspath_prepend(folder)
    site.modules.extend(["packed_thing", "packed_thing.plugin", "packed_thing.features"])
    site.metadata("packed-thing", "0.2", "[graspsense.plugins]\nlab = packed_thing.plugin\n")
    (site.folder / "packed_thing-0.2.dist-info" / "direct_url.json").write_text(
        json.dumps({"url": folder.as_uri(), "dir_info": {"editable": True}})
    )
    (check,) = [check for check in CHECKS["distribution"] if check.id == "wheel-is-complete"]
    whole = package._built(folder, tmp_path)

    for lacking, says in (
        ("", ""),
        ("packed_thing/lab.toml", "lacks packed_thing/lab.toml: it is in the folder"),
        ("packed_thing/features.py", "lacks packed_thing/features.py: it is in the"),
        ("packed_thing/table.csv", "lacks packed_thing/table.csv: it is in the folder"),
    ):
        monkeypatch.setattr(package, "_built", partial(without, whole, lacking))
        result = outcome_of(check, package_of("packed-thing", site.discover()), {})

        assert result.state == ("failed" if says else "passed")
        assert says in result.text


def without(wheel, lacking, folder, scratch):
    """Return a copy of a wheel that lacks this file, in place of building one."""
    with zipfile.ZipFile(wheel) as whole, zipfile.ZipFile(scratch / wheel.name, "w") as copy:
        for name in set(whole.namelist()) - {lacking}:
            copy.writestr(name, whole.read(name))
    return scratch / wheel.name
