"""The generated pages and the drawing are current, and the commands and examples of the other pages are valid."""

import doctest
import pkgutil
import re
import shlex
import sys

import click
import numpy
import pytest
from cases import every_case
from repository import ROOT, script_of_docs
from test_imports import DOORS, MAY_KNOW, ROOMS

from graspsense import plugin_api, simulator_api
from graspsense.cli.main import cli
from graspsense.experiments.experiment_file import read_experiment

PAGES = script_of_docs("role_pages")
DRAWING = script_of_docs("package_drawing")


@every_case("name", PAGES.PAGES)
def test_a_page_that_is_made_from_the_code_is_what_the_code_says(name):
    written = (ROOT / "docs" / "roles" / f"{name}.md").read_text(encoding="utf-8")
    assert written == PAGES.PAGES[name](), "run: python docs/role_pages.py"


@pytest.mark.slow
def test_the_drawing_of_the_packages_is_that_of_the_imports_which_form_no_circle():
    assert DRAWING.FILE.read_text() == DRAWING.drawing(), "run: python docs/package_drawing.py"
    for graph in (DRAWING.host_subpackages(), *map(DRAWING.rooms_of, ROOMS), DRAWING.simulator_subpackages()):
        DRAWING.in_order(graph)  # raises CycleError for a circle of imports


def architecture_rows(title):
    """The cells of the table in a section of docs/architecture.md."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    section = page.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    return [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| `")]


def test_every_name_that_all_plugins_share_is_on_a_page_with_its_meaning():
    pages = "\n".join(page.read_text(encoding="utf-8") for page in PAGES.FOLDER.glob("*.md"))
    for name in plugin_api.__all__:
        row = re.search(rf"^\| `{name}(?:\(.*)?` \| (.+) \|$", pages, re.MULTILINE)
        assert row, name
        assert "the value " not in row[1][:10], f"{name} has no docstring"


HELPERS = [name for names in PAGES.HELPERS.values() for name in names if callable(PAGES.public(name))]


@every_case("name", HELPERS)
def test_a_helper_has_an_example_that_holds(name):
    helper = PAGES.public(name)
    finder = doctest.DocTestFinder(recurse=False)
    (example,) = finder.find(helper, name, globs={**vars(sys.modules[helper.__module__]), "np": numpy})
    if name != "RestState":
        assert example.examples, f"{name} has no example in its docstring"

    assert doctest.DocTestRunner().run(example).failed == 0


def test_the_example_of_a_compiled_form_of_features_holds():
    (example,) = doctest.DocTestFinder(recurse=False).find(simulator_api.CompiledFeatures, globs={})
    assert example.examples
    assert doctest.DocTestRunner().run(example).failed == 0


def test_the_table_of_packages_is_the_rule_that_is_enforced():
    packages = {name: used for name, used in MAY_KNOW.items() if not name.startswith("__")}
    table = {row[0].strip("`"): set(re.findall(r"`(\w+)`", row[2])) for row in architecture_rows("Packages")}
    unused = {"plugins", *DOORS}
    assert table.pop("cli") == unused, "the cli may use all packages but these"
    packages["cli"] |= unused
    assert packages.pop("cli") == packages.keys() | {"cli"}
    assert table == {name: used - {name} for name, used in packages.items()}


def test_the_tables_of_rooms_are_their_order_and_that_of_the_simulator_has_every_folder():
    folders = [
        room
        for package, rooms in ROOMS.items()
        for room in rooms
        if (ROOT / "src" / "graspsense" / package / room).is_dir()
    ]
    assert [row[0].strip("`") for row in architecture_rows("Rooms")] == folders
    package = ROOT / "plugins" / "sim_gripper" / "src" / "graspsense_sim_gripper"
    folders = {path.parent.name for path in package.glob("*/__init__.py")}
    named = {row[0].strip("`") for row in architecture_rows("The simulator")}
    assert named == folders - {"models"}, "the table of docs/architecture.md has one row for each folder"


def test_every_place_to_change_something_exists():
    page = (ROOT / "docs" / "architecture.md").read_text()
    table = page.partition("\n## Where to change what\n")[2].partition("\n## ")[0]
    places = re.findall(r"`([\w/]+(?:\.py|/))`", table)
    assert len(places) > 25
    folders = (ROOT / "src" / "graspsense", *ROOT.glob("plugins/*/src/*"))
    files = {f"/{path.relative_to(ROOT)}" for folder in folders for path in folder.rglob("*.*")}
    missing = [place for place in places if not any(f"/{place}" in file for file in files)]
    assert not missing


def code(page, count):
    """Return the lines of code of the first Python examples of a page, without blank lines."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL)
    return [line for block in blocks[:count] for line in block.splitlines() if line.strip()]


def test_a_feature_set_takes_fewer_than_twenty_lines_and_a_gripper_fewer_than_a_hundred():
    assert len(code("tutorial.md", 1)) < 20
    assert "graspsense_feature_sets" in "".join(code("tutorial.md", 1))
    lines = [line for line in code("roles/sensor-backend.md", 2) if not line.strip().startswith('"""')]
    assert len(lines) < 100
    assert any("def read" in line for line in lines)


def printed_commands():
    """Every command in a page: between backticks, in an indented line, or in a block of code."""
    pages = (path for pattern in ("README.md", "docs/*.md", "*/*/README.md") for path in ROOT.glob(pattern))
    for page in pages:
        text = re.sub(r"\\\n\s+", " ", page.read_text(encoding="utf-8"))
        blocks = "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
        lines = re.findall(r"(?:`|^    )(?:sudo )?(graspsense [^`\n]+)", text, re.MULTILINE)
        lines += re.findall(r"^(graspsense [^\n]+)", blocks, re.MULTILINE)
        for line in sorted({line for line in lines if line.split()[1].islower()}):
            yield page.relative_to(ROOT), line


def test_a_printed_command_and_its_options_exist():
    lines = [*printed_commands()]
    assert lines
    for page, line in lines:
        assert options_of(line) <= options_known(line), f"{page}: {line}"


def options_of(line):
    words = shlex.split(line, comments=True)[1:]
    return {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)} - {"--help"}


def options_known(line):
    words = shlex.split(line, comments=True)[1:]
    command, context = cli, click.Context(cli)
    while isinstance(command, click.Group) and words and not words[0].startswith("-") and "|" not in words[0]:
        command = command.get_command(context, words.pop(0))
        assert command is not None, line
    return {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}


def in_backticks(pattern):
    """Every text between backticks of this form, with the page that has it."""
    pages = (
        path
        for glob in ("README.md", "CONTRIBUTING.md", "docs/*.md", "specs/*.md")
        for path in ROOT.glob(glob)
    )
    names = {(page.name, name) for page in pages for name in re.findall(rf"`({pattern})`", page.read_text())}
    assert names
    return sorted(names)


METADATA = ("graspsense.device", "graspsense.trial")
"""Names of metadata records in a recording."""


def test_a_module_or_name_that_a_page_mentions_exists():
    for page, name in in_backticks(r"graspsense(?:_\w+)?(?:\.\w+)+"):
        assert name in METADATA or pkgutil.resolve_name(name) is not None, page


def test_a_file_that_a_page_mentions_exists():
    folders = (ROOT, ROOT / "src" / "graspsense", *ROOT.glob("plugins/*"), *ROOT.glob("plugins/*/src/*"))
    made_by_users = ("results/", "lab_", "OUT/", "~", "/")
    for page, name in in_backticks(r"[\w./]+/[\w.]+\.(?:py|toml|md|json)"):
        assert name.startswith(made_by_users) or any((folder / name).exists() for folder in folders), (
            f"{page}: {name}"
        )


def test_the_example_of_an_experiment_is_one(tmp_path):
    page = (ROOT / "docs" / "experiments.md").read_text()
    (text,) = re.findall(r"<!-- experiment: example -->\n```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    assert len(read_experiment(str(tmp_path / "mine.toml"), []).cases) == 3


def test_the_navigation_has_every_page_and_no_other():
    named = set(re.findall(r": ([\w/.-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    folders = ("docs", "docs/roles", "specs", "examples/*", "plugins/*", ".")
    there = {str(path.relative_to(ROOT)) for folder in folders for path in ROOT.glob(f"{folder}/*.md")}
    assert named == there, "each page has its place in the nav of mkdocs.yml"


def documents():
    """Return the pages and the messages that tell users which command to type."""
    folders = [ROOT / "docs", ROOT / "src", ROOT / "plugins", ROOT / "examples"]
    files = [
        path for folder in folders for path in folder.rglob("*.*") if path.suffix in (".md", ".py", ".txt")
    ]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *files]


def test_no_document_calls_graspsense_by_sudo_which_does_not_find_it_in_an_environment():
    wrong = [path.name for path in documents() if re.search(r"sudo\s+(-\S+\s+)*graspsense", path.read_text())]

    assert wrong == []
