"""The import rules of the house, held on the source text and in a fresh interpreter."""

import ast
import importlib
import re
from pathlib import Path

import pytest
from cases import every_case
from commands import python
from repository import ROOT
from source_code import parsed, statements

import graspsense
from graspsense import plugin_api
from graspsense.core.components.moved_names import REPLACED, SPECIAL

SOURCE = ROOT / "src" / "graspsense"

DOORS = ("plugin_api", *SPECIAL)
"""The modules that plugins may import from."""

MAY_KNOW = {
    "__main__": {"cli"},
    "core": {"core"},
    "plugins": {*DOORS, "plugins"},
    "recording": {"core", "recording"},
    "store": {"core", "recording", "store"},
    "sources": {"core", "recording", "store", "sources"},
    "live": {"core", "recording", "live"},
    "evaluation": {"core", "evaluation"},
    "regression": {"core", "evaluation", "regression"},
    "report": {"core", "recording", "store", "evaluation", "regression", "report"},
    "experiments": {"core", "recording", "sources", "evaluation", "report", "experiments"},
    "cli": {
        *("core", "recording", "store", "sources", "evaluation", "regression"),
        *("experiments", "live", "report", "scaffold", "testing", "cli"),
    },
    "testing": {"core", "plugin_api", "testing_api", "recording", "sources", "testing"},
    "scaffold": {"core", "scaffold"},
    **{door: {"core"} for door in DOORS},
    "__init__": {"core"},
}
"""Subpackage to the subpackages it may import from; every subpackage may import the package itself, for its version."""

ROOMS = {
    "core": (
        *("values", "files", "control", "components", "settings"),
        *("grasp", "drivers", "compiling", "learn", "pipeline"),
    ),
    "sources": (
        *("units", "formats", "columns", "trial_table", "manifest", "recordings", "importing"),
        *("input_content", "simulated", "identified", "trial_source", "squeezes"),
    ),
}
"""The rooms of a package, and its files outside of rooms. Each may import from those before it."""
OPENED_TO = {"identify": {"graspsense_sim_gripper.run.identification"}}
"""Distribution to the modules of others that it may import besides the doors."""

MODULE_AS_TEXT = re.compile(
    rf"graspsense\.(({'|'.join(sorted(MAY_KNOW.keys() - {'core', 'plugins', *DOORS}))}|core\.\w+)(\.|$)|plugins\.)"
)
"""What `import_module` could be given to reach around the rules. `graspsense.plugins` is the group of entry points."""

HEAVY = {"numpy", "scipy", "sklearn", "numba", "pandas", "matplotlib", "hid", "hidraw", "usb", "cattrs"}


def imported(tree, package):
    """Yield every module that this source imports, at whatever depth; `package` is what holds it."""
    for node in statements(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            # `from graspsense import core` imports a subpackage as well as `from graspsense.core import ...`.
            yield from (
                f"{module}.{alias.name}" if module == "graspsense" else module for alias in node.names
            )


def subpackages_known(path, package):
    """Return the subpackages of graspsense that a file imports from."""
    names = imported(parsed(path), package)
    within = (name.split(".")[1] for name in names if name.startswith("graspsense."))
    return {
        subpackage
        for subpackage in within
        if (SOURCE / subpackage).is_dir() or (SOURCE / f"{subpackage}.py").is_file()
    }


def files(folder):
    return sorted(path for path in folder.rglob("*.py") if "tests" not in path.relative_to(folder).parts)


def distributions():
    return sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))


def test_a_subpackage_knows_only_the_subpackages_it_may():
    for path in files(SOURCE):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        package = ".".join(["graspsense", *parts[:-1]])
        assert subpackages_known(path, package) <= MAY_KNOW[parts[0]], path.relative_to(SOURCE)


def package_of(distribution):
    (package,) = [
        path for path in (distribution / "src").iterdir() if path.is_dir() and path.name != "__pycache__"
    ]
    return package


def modules(package=SOURCE):
    """Return the path of each module of a package."""
    names = {}
    for path in files(package):
        parts = (package.name, *path.relative_to(package).with_suffix("").parts)
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return names


def imports_of(name, known):
    """Return the modules that a module imports in any way: at its beginning, late, or for types alone."""
    imported = set()
    for node in statements(parsed(known[name])):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name} imports from a package without its full name"
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            imported |= inner & known.keys() or {node.module}
    return imported & known.keys()


@every_case(("package", "rooms"), ROOMS.items())
def test_a_room_knows_those_before_it_only(package, rooms):
    known, begin = modules(), f"graspsense.{package}."
    for name in known:
        if name.startswith(begin):
            room = name.split(".")[2]
            allowed = {f"{begin}{earlier}" for earlier in rooms[: rooms.index(room) + 1]}
            within = [imported for imported in imports_of(name, known) if imported.startswith(begin)]
            assert {".".join(imported.split(".")[:3]) for imported in within} <= allowed, name


@pytest.mark.slow
@every_case("package", [SOURCE, *map(package_of, distributions())])
def test_no_module_imports_itself_through_others(package):
    known = modules(package)
    waiting = {name: imports_of(name, known) - {name, package.name} for name in known}
    while ready := [name for name, needed in waiting.items() if not needed & waiting.keys()]:
        for name in ready:
            del waiting[name]

    assert not waiting, f"among these is a circle: {sorted(waiting)}"


def test_core_names_the_other_subpackages_in_one_place_only():
    for path in files(SOURCE / "core"):
        strings = [node.value for node in ast.walk(parsed(path)) if isinstance(node, ast.Constant)]
        named = [text for text in strings if isinstance(text, str) and MODULE_AS_TEXT.match(text)]
        assert not named or path.name == "firstparty.py", f"{path.name} names {named}"


@every_case("folder", distributions())
def test_a_distribution_knows_the_door_for_authors_only(folder):
    package = package_of(folder)
    for path in files(package):
        names = set(imported(parsed(path), package.name))
        known = {name for name in names if name.split(".")[0] == "graspsense"}
        allowed = {f"graspsense.{door}" for door in DOORS}
        # The trees need nothing of graspsense; the compiled engine does, and is optional.
        if folder.name == "c45" and path.name not in {"plugin.py", "compiled.py"}:
            allowed = set()
        assert known <= allowed, f"{path.relative_to(folder)} imports {sorted(known - allowed)}"


@every_case("folder", distributions())
def test_a_distribution_knows_no_other(folder):
    others = {f"graspsense_{distribution.name}" for distribution in distributions()} - {
        f"graspsense_{folder.name}"
    }
    for path in files(folder / "src"):
        names = imported(parsed(path), "")
        known = {name for name in names if name.split(".")[0] in others}
        known -= OPENED_TO.get(folder.name, set())
        assert not known, f"{path.relative_to(folder)} imports {sorted(known)}"


def loaded_after(code, *arguments):
    """Run code in a fresh interpreter; return the top-level names of the modules it loaded."""
    code += "\nimport sys; print('loaded:', *{name.split('.')[0] for name in sys.modules}, file=sys.stderr)"
    ran = python("-c", code, *arguments)
    assert ran.returncode == 0, ran.stderr
    (line,) = [line for line in ran.stderr.splitlines() if line.startswith("loaded:")]
    return set(line.split()[1:])


def name_of(node):
    """Return the name, or the name in a module, that this is; nothing where it is neither."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def test_nothing_loads_what_could_run_code():
    # joblib and dill are pickle by other names; cloudpickle is what Dask would bring.
    banned = {"pickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "copyreg"}
    banned_word = re.compile(rf"\b({'|'.join(banned)})\b")
    array_word = re.compile(r"allow_pickle|\bload\b|read_array")
    paths = [*files(SOURCE), *files(ROOT / "plugins"), *files(ROOT / "examples")]
    assert len(paths) > 200
    for path in paths:
        text = path.read_text(encoding="utf-8")
        roots = (
            {name.split(".")[0] for name in imported(parsed(path), "")} if banned_word.search(text) else set()
        )
        assert not roots & banned, f"{path.relative_to(ROOT)} imports {sorted(roots & banned)}"
        for node in ast.walk(parsed(path)) if array_word.search(text) else ():
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert ast.unparse(node.value) == "False", f"{path.relative_to(ROOT)}:{node.value.lineno}"
            if isinstance(node, ast.Call) and name_of(node.func) in {"np.load", "numpy.load", "read_array"}:
                # What it does by default is left to the version of numpy.
                assert "allow_pickle" in {keyword.arg for keyword in node.keywords}, f"{path}:{node.lineno}"


COMMANDS = """
import sys
from graspsense.cli.main import main
for command in {}:
    try:
        main(command)
    except SystemExit as ended:
        assert ended.code == 0, ended.code
"""


ALL_DOORS = f"import graspsense, {', '.join(f'graspsense.{door}' for door in DOORS)}"


@pytest.mark.slow
@every_case(
    ("code", "left_out"),
    [
        (ALL_DOORS, HEAVY | {"pluggy", "attr", "click"}),
        ("import graspsense.plugins.builtin", HEAVY | {"click"}),
        ("import graspsense.cli.experiment", {"numpy", "dask", "distributed", "matplotlib"}),
        (COMMANDS.format([["--help"], ["--version"], []]), HEAVY | {"pluggy", "attr"}),
        (COMMANDS.format([["plugins", "list"], ["plugins", "list", "--json"]]), HEAVY),
    ],
)
def test_doors_plugins_and_short_commands_load_nothing_heavy(code, left_out):
    loaded = loaded_after(code)
    assert not loaded & left_out
    assert "plugins" in code or not [name for name in loaded if name.startswith("graspsense_")]


PUBLIC_MODULES = [graspsense, *(importlib.import_module(f"graspsense.{door}") for door in DOORS)]


@every_case("door", PUBLIC_MODULES)
def test_each_public_module_lists_a_name_once_and_in_a_group(door):
    names = [name for group in door.PUBLIC.groups.values() for name, _ in group]
    stub = Path(door.__file__ + "i").read_text()
    assert sorted(names) == door.PUBLIC.names == sorted(re.findall(r" as (\w+)$", stub, re.MULTILINE))
    assert len(set(names)) == len(names)


@every_case("door", PUBLIC_MODULES)
def test_every_name_of_a_door_can_be_imported(door):
    for name in door.__all__:
        assert getattr(door, name) is not None
        assert name in dir(door)
    with pytest.raises(AttributeError, match="'nosuch'"):
        door.nosuch  # noqa: B018


def test_what_every_plugin_may_import_are_at_most_seventy_names_that_no_special_module_repeats():
    assert len(plugin_api.__all__) <= 70
    special = [name for door in PUBLIC_MODULES[2:] for name in door.__all__ if name != "structured"]
    assert len(special) == len(set(special))
    assert not set(special) & set(plugin_api.__all__)
    assert not set(REPLACED) & {*special, *plugin_api.__all__}


def test_a_name_that_moved_says_where_it_is_now():
    with pytest.raises(ImportError, match=r"from graspsense\.gripper_api import tare"):
        from graspsense.plugin_api import tare  # noqa: F401
    with pytest.raises(ImportError, match="import RestState"):
        from graspsense.plugin_api import Stillness  # noqa: F401


def test_examples_need_nothing_of_the_simulators_module():
    paths = [path for path in (ROOT / "examples").rglob("*.py") if "mujoco" not in path.parts]
    assert paths
    for path in paths:
        assert "graspsense.simulator_api" not in set(imported(parsed(path), "")), path.relative_to(ROOT)


def test_settings_are_read_without_the_simulator():
    loaded = loaded_after("from graspsense.core.settings.resolved import resolve; resolve('default')")

    assert not {name for name in loaded if name.startswith("graspsense_sim_gripper.")} - {
        "graspsense_sim_gripper.plugin",
        "graspsense_sim_gripper.config",
    }
    assert not loaded & {"numpy", "numba", "sklearn"}
