"""Limits of functions, their parameters, the fields of tuples, and what tests expect; each exception has a reason.

The length of a function counts every line from `def` to the end of its body, with the docstring. Parameters count
without `self` and `cls`. The limits hold everywhere; only that of the fields of a NamedTuple in the simulator, whose
tuples are passed through compiled code.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from itertools import chain
from typing import Final

from repository import ROOT
from source_code import parsed, statements

SOURCES = (ROOT / "src", *sorted((ROOT / "plugins").glob("*/src")))
SIMULATOR = "graspsense_sim_gripper"

MAX_LINES: Final = 60
MAX_PARAMETERS: Final = 7
MAX_FIELDS: Final = 8
MAX_BY_POSITION: Final = 4

EXPECTED: Final = re.compile(r"""match=[rf]*(["'])(.+?)\1|(["'])([^"']+)\3 in """)
"""A text that a test looks for in a message."""
SENTENCE: Final = re.compile(r"\b(?!graspsense )[A-Za-z]*[a-z](?: [a-z]+){3}\b")
"""Four words in sequence, but for those of a command."""

OPTIONS: Final = "a click command: one parameter for each option"

LONG_FUNCTIONS: dict[str, str] = {}
"""Functions over `MAX_LINES` lines, as `path:name`, with the reason or the measured cost of a shorter form."""

MANY_PARAMETERS = {
    "graspsense/cli/evaluate.py:evaluate": OPTIONS,
    "graspsense/cli/experiment.py:experiment": OPTIONS,
    "graspsense/cli/identify.py:identify": OPTIONS,
    "graspsense/cli/import_.py:import_": OPTIONS,
    "graspsense/cli/report.py:report": OPTIONS,
    "graspsense/cli/run.py:run": OPTIONS,
    "graspsense/cli/train.py:train": OPTIONS,
    "graspsense/core/components/setting.py:setting": "public; every part of a declaration is optional, by keyword only",
    "graspsense/core/drivers/transmission.py:screw_linkage": "the ten constants of a linkage, by keyword only",
    "graspsense/evaluation/crossval.py:cross_validate": "public; three optional ones are by keyword only",
    "graspsense/evaluation/evaluate.py:evaluate": "public; all settings of an evaluation, by keyword only",
    "graspsense/store/record_grasp.py:record_grasp": "what, where, and who watches; all but three by keyword only",
    "graspsense/testing/conformance.py:examine": "public; all that a check can be told, by keyword only",
    "graspsense_c45/classifier.py:__init__": "scikit-learn requires an explicit parameter for each setting",
}
"""Functions with more than `MAX_PARAMETERS` parameters, with the reason."""

LARGE_TUPLES: dict[str, str] = {}
"""NamedTuples of the simulator with more than `MAX_FIELDS` fields, with the reason or the measured cost."""


@cache
def files():
    return [
        (path.relative_to(source).as_posix(), path)
        for source in SOURCES
        for path in sorted(source.rglob("*.py"))
    ]


def modules():
    for name, path in files():
        yield name, parsed(path)


@cache
def functions():
    return [
        (f"{name}:{node.name}", node)
        for name, tree in modules()
        for node in statements(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]


def lines(function):
    assert function.end_lineno is not None
    return function.end_lineno - function.lineno + 1


def parameters(function):
    arguments = function.args
    names = [value.arg for value in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def fields(node):
    return sum(isinstance(statement, ast.AnnAssign) for statement in node.body)


@cache
def named_tuples():
    """Return the number of fields of each NamedTuple, by `path:name`."""
    return {
        f"{name}:{node.name}": fields(node)
        for name, tree in modules()
        for node in statements(tree)
        if isinstance(node, ast.ClassDef)
        and any(isinstance(base, ast.Name) and base.id == "NamedTuple" for base in node.bases)
    }


def test_no_function_and_no_tuple_of_the_simulator_is_over_its_limit():
    fields_of = [item for item in named_tuples().items() if item[0].startswith(SIMULATOR)]
    for what, counts, limit, exceptions in (
        ("lines", [(name, lines(node)) for name, node in functions()], MAX_LINES, LONG_FUNCTIONS),
        (
            "parameters",
            [(name, parameters(node)) for name, node in functions()],
            MAX_PARAMETERS,
            MANY_PARAMETERS,
        ),
        ("fields", fields_of, MAX_FIELDS, LARGE_TUPLES),
    ):
        over = {name for name, count in counts if count > limit}
        assert over <= exceptions.keys(), (
            f"more than {limit} {what}: divide them, or add an exception with its reason"
        )
        assert exceptions.keys() <= over, f"no longer over {limit} {what}: remove these exceptions"
        assert all(exceptions.values())


def test_no_large_tuple_is_built_by_position():
    # Two numbers in each other's place have the right type.
    large = {name.split(":")[1] for name, count in named_tuples().items() if count > MAX_BY_POSITION}
    calls = re.compile(rf"^(?!class ).*\b({'|'.join(large)})\(", re.MULTILINE)
    by_position = [
        f"{name}:{call.lineno}"
        for name, path in files()
        if calls.search(path.read_text(encoding="utf-8"))
        for call in ast.walk(parsed(path))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and call.func.id in large
        and (
            len(call.args) > MAX_BY_POSITION
            # A row whose order somebody else has set is given as a whole.
            or any(isinstance(argument, ast.Starred) for argument in call.args[1:])
        )
    ]
    assert not by_position, f"more than {MAX_BY_POSITION} fields by position: name them"


def test_no_test_expects_a_sentence():
    # What a user needs of a message is its kind, its names and its values, however it is worded.
    tests = chain((ROOT / "tests").rglob("*.py"), (ROOT / "plugins").glob("*/tests/**/*.py"))
    sentences = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in tests
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if any(SENTENCE.search(text[1] or text[3]) for text in EXPECTED.findall(line))
    ]
    assert not sentences, "look for names and values, or for three words at most"
