"""What an installation rests on: every part is installed, every version is pinned, our own versions agree."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, requires

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from repository import ROOT

FOLDERS = sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))


def toml(path):
    return tomllib.loads(path.read_text())


PROJECT = toml(ROOT / "pyproject.toml")
PLUGINS = {toml(folder / "pyproject.toml")["project"]["name"]: folder.name for folder in FOLDERS}


def requirement_lines():
    lines = (ROOT / "requirements-dev.txt").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def pinned():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


def test_every_folder_under_plugins_is_a_distribution():
    assert sorted(path.name for path in (ROOT / "plugins").iterdir() if (path / "src").is_dir()) == [
        folder.name for folder in FOLDERS
    ]
    assert set(PLUGINS.values()) >= {"c45", "pr2_gripper", "sim_gripper"}


def test_requirements_install_every_distribution_in_editable_form_and_the_tools_that_uv_installs():
    editable = [line.removeprefix("-e ") for line in requirement_lines() if line.startswith("-e ")]
    assert editable == [".", *(f"./plugins/{folder.name}" for folder in FOLDERS)]
    assert "-c constraints.txt" in requirement_lines()
    tools = [line for line in requirement_lines() if not line.startswith("-")]
    assert tools == PROJECT["dependency-groups"]["dev"]


def test_an_installation_for_use_has_every_distribution_with_the_same_versions():
    default, added = (
        [line for line in (ROOT / name).read_text().splitlines() if line[:1] != "#"]
        for name in ("requirements.txt", "requirements-all.txt")
    )
    assert (default[0], added[0]) == ("-c constraints.txt", "-r requirements.txt")
    lines = sorted([*default[1:], *added[1:]])
    assert [line for line in lines if line.startswith(".")] == [
        ".",
        *(f"./plugins/{folder.name}" for folder in FOLDERS),
    ]
    tools = PROJECT["dependency-groups"]["dev"]
    assert [line for line in lines if not line.startswith(".")] == [
        line for line in tools if line.startswith(("matplotlib", "numba", "websockets"))
    ]


def test_groups_sources_and_extras_have_every_plugin():
    names = sorted(PLUGINS)
    assert sorted(PROJECT["dependency-groups"]["plugins"]) == names
    assert sorted(PROJECT["tool"]["uv"]["sources"]) == ["graspsense", *names]
    extras = PROJECT["project"]["optional-dependencies"]
    of_plugins = {name: extra for extra, (name, *_) in extras.items() if name in PLUGINS}
    assert set(of_plugins) == set(PLUGINS)
    assert extras["all"] == [f"graspsense[{','.join(sorted(of_plugins.values()))}]"]


def test_constraints_are_plain_versions():
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        assert re.fullmatch(r"#.*|[a-z0-9-]+==[0-9][0-9a-z.]*", line), line


def test_constraints_pin_everything_that_is_installed_with_us():
    """From our own requirements on, through the metadata of what is installed, whatever applies here."""
    todo = [Requirement(line) for line in requirement_lines() if not line.startswith("-")]
    for folder in [ROOT, *FOLDERS]:
        project = toml(folder / "pyproject.toml")["project"]
        extras = project.get("optional-dependencies", {}).values()
        todo += map(Requirement, [*project["dependencies"], *(line for extra in extras for line in extra)])
    ours, versions, seen = {"graspsense", *PLUGINS}, pinned(), set()
    while todo:
        requirement = todo.pop()
        name = canonicalize_name(requirement.name)
        if (name, *sorted(requirement.extras)) in seen or name in ours:
            continue
        seen.add((name, *sorted(requirement.extras)))
        assert name in versions, f"{requirement} is not pinned in constraints.txt"
        assert versions[name] in requirement.specifier, (
            f"constraints.txt has {name}=={versions[name]}, asked is {requirement}"
        )
        try:
            further = map(Requirement, requires(name) or [])
        except PackageNotFoundError:
            continue  # an extra that is not installed here
        contexts = [{"extra": extra} for extra in requirement.extras or {""}]
        todo += [r for r in further if r.marker is None or any(map(r.marker.evaluate, contexts))]
    assert len(seen) > len(requirement_lines())


def test_versions_of_the_project_agree():
    version = PROJECT["project"]["version"]
    for folder in FOLDERS:
        project = toml(folder / "pyproject.toml")["project"]
        assert project["version"] == version
        for line in project["dependencies"]:
            if (ours := Requirement(line)).name == "graspsense":
                assert version in ours.specifier


def test_every_distribution_carries_licence_and_type_marker():
    licence = (ROOT / "LICENSE").read_text()
    for folder in [ROOT, *FOLDERS]:
        assert (folder / "LICENSE").read_text() == licence
        assert len(list((folder / "src").glob("*/py.typed"))) == 1
