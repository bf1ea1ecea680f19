"""The pages on the roles are those that the code gives, and the tutorial's plugin is as short as it is said to be."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGES = script("role_pages")
ROOMS = script("room_drawing")


@pytest.mark.parametrize("role", PAGES.TITLES)
def test_the_page_of_a_role_is_what_the_code_says(role):
    written = (ROOT / "docs" / "roles" / f"{role}.md").read_text()
    assert written == PAGES.page(role), "run: python docs/role_pages.py"


def test_the_page_of_what_flows_is_what_the_code_says():
    written = (ROOT / "docs" / "roles" / "signals.md").read_text()
    assert written == PAGES.signals_page(), "run: python docs/role_pages.py"


def test_the_page_of_the_hooks_is_what_the_code_says():
    written = (ROOT / "docs" / "roles" / "hooks.md").read_text()
    assert written == PAGES.hooks_page(), "run: python docs/role_pages.py"


def test_the_drawing_of_the_rooms_is_that_of_the_imports():
    assert ROOMS.FILE.read_text() == ROOMS.drawing(), "run: python docs/room_drawing.py"


def test_no_room_imports_in_a_circle():
    for graph in (ROOMS.host_rooms(), ROOMS.simulator_rooms()):
        assert not ROOMS.panel(graph).against


def test_an_arrow_that_follows_from_others_is_left_out_and_a_circle_shows():
    chain = {"a": {"b", "c"}, "b": {"c"}, "c": set()}
    assert ROOMS.reduced(chain) == {"a": {"b"}, "b": {"c"}, "c": set()}
    assert not ROOMS.panel(chain).against
    assert ROOMS.panel({"a": {"b"}, "b": {"a"}}).against


def code(page, count):
    """Return the lines of code of the first Python examples of a page, without blank lines."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL)
    return [line for block in blocks[:count] for line in block.splitlines() if line.strip()]


def test_a_feature_set_takes_fewer_than_twenty_lines():
    assert len(code("tutorial.md", 1)) < 20
    assert "graspsense_feature_sets" in "".join(code("tutorial.md", 1))


def test_a_gripper_takes_fewer_than_a_hundred_lines():
    lines = [line for line in code("roles/sensor-backend.md", 2) if not line.strip().startswith('"""')]
    assert len(lines) < 100
    assert any("def read" in line for line in lines)


def test_the_navigation_has_every_page_and_no_other():
    named = set(re.findall(r": ([\w/.-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    folders = ("docs", "docs/roles", "specs", "examples/*", "plugins/*", ".")
    there = {str(path.relative_to(ROOT)) for folder in folders for path in ROOT.glob(f"{folder}/*.md")}
    assert named == there, "each page has its place in the nav of mkdocs.yml"
