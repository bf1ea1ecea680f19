"""Compiling a function with all it calls: what is compiled, what is refused, and what is loaded from disk."""

import math
import os
import sys
import textwrap
from enum import IntEnum

import numpy as np
import pytest
from commands import python

from graspsense.core.compiling import compiled_code_folder as folder_module
from graspsense.core.compiling import compiling
from graspsense.core.compiling.compiled_code_folder import compiled_code_folder, delete_older_half
from graspsense.simulator_api import (
    CompileOptions,
    NotCompilable,
    bind,
    compile_function,
    entry_point,
    fingerprint,
    first_call,
)

pytest.importorskip("numba", reason="compiling needs the extra `fast`")

FACTOR = 2.0
TABLE = np.array([1.0, 2.0])


class Gear(IntEnum):
    LOW = 1


def half(x):
    return x


def _calls_half(x):
    return half(x)


def _twice(x):
    return 2.0 * x


def _thrice(x):
    return 3.0 * x


helper = _twice


def _scaled(x):
    return FACTOR * helper(x)


def _by_constants(x):
    return TABLE[0] * Gear.LOW * math.pi * x


def _countdown(n):
    return 0 if n == 0 else _countdown(n - 1)


def _divided(x, y):
    return x / y


def _labelled(x):
    # A formatted float is outside the compiler's subset.
    return len(f"{x:.3f}")


# ---------------------------------------------------------------------------------------------- fingerprints


def test_a_fingerprint_changes_with_constants_called_functions_and_defaults():
    assert fingerprint(bind(_scaled, FACTOR=2.0)) == fingerprint(_scaled)
    numbers = type(math)("math")
    numbers.pi = 3.0
    for function, changes in (
        (_scaled, {"FACTOR": 3.0}),
        (_scaled, {"FACTOR": 2}),
        (_scaled, {"helper": _thrice}),
        # What an array, an enumeration or a module holds is a constant in the machine code.
        (_by_constants, {"TABLE": np.array([1.0, 3.0])}),
        (_by_constants, {"Gear": IntEnum("Gear", {"LOW": 2}, module=__name__)}),
        (_by_constants, {"math": numbers}),
    ):
        assert fingerprint(bind(function, **changes)) != fingerprint(function), changes
    assert fingerprint(_scaled, {_twice: _thrice}) == fingerprint(bind(_scaled, helper=_thrice))


def test_a_fingerprint_covers_the_functions_that_generate_the_code_of_an_intrinsic():
    from numba.extending import intrinsic

    def of_half_with(generator):
        def half(context, x):
            return _twice(x), None

        return fingerprint(bind(_calls_half, half=intrinsic(bind(half, _twice=generator))))

    assert of_half_with(_twice) == of_half_with(_twice) != of_half_with(_thrice)


def test_closures_recursion_and_builtins_are_refused_by_name_before_they_are_called():
    factor = 2.0

    def closing_over(x):
        return factor * x

    refused = {closing_over: "closing_over is a closure over factor", _countdown: "_countdown calls itself"}
    for function, says in {**refused, len: "len> is not a plain function"}.items():
        for ask in (fingerprint, compile_function):
            with pytest.raises(NotCompilable, match=says):
                ask(function)


# ------------------------------------------------------------------------------------------------- compiling


def test_what_the_compiler_refuses_is_named_by_file_and_line():
    compiled = compile_function(_labelled)
    with pytest.raises(NotCompilable, match=r"test_compiling.py:\d+"), first_call():
        compiled(1.0)


def test_a_function_is_compiled_once_and_gives_what_the_interpreter_gives():
    compiled = compile_function(_scaled)
    assert compiled(1.5) == entry_point(compiled)(1.5) == _scaled(1.5) == 6.0
    assert compile_function(_scaled) is compiled


def _checked(x):
    if x < 0.0:
        raise ValueError("below zero", x)
    return x


def _twice_checked(x):
    return 2.0 * _checked(x)


def test_a_called_function_raises_with_values_as_soon_as_it_is_compiled(tmp_path, monkeypatch):
    # Nothing is loaded from disk, where numba itself gives called functions what they need for it.
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    compiled = compile_function(_twice_checked)
    with pytest.raises(ValueError) as raised, first_call():
        compiled(-1.0)
    assert raised.value.args == ("below zero", -1.0)
    assert compiled(2.0) == 4.0


def _descending(x):
    return -_twice(x)


def _largest(numbers):
    listed = list(numbers)
    listed.sort(key=_descending)
    return listed[0]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Cannot cache compiled function")
def test_a_function_of_numba_calls_one_of_ours_with_all_that_it_calls(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    compiled = compile_function(_largest)
    with first_call():
        assert compiled(np.array([1.0, 3.0, 2.0])) == 3.0


def test_code_compiled_under_other_options_is_other_code():
    with pytest.raises(ZeroDivisionError):
        compile_function(_divided)(1.0, 0.0)
    assert compile_function(_divided, CompileOptions(error_model="numpy"))(1.0, 0.0) == math.inf
    assert compile_function(_scaled, CompileOptions(replacements={_twice: _thrice}))(1.0) == 6.0
    assert compile_function(_scaled)(1.0) == 4.0


def test_without_numba_the_message_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(NotCompilable, match=r'numba.*"box\[fast\]"'):
        compile_function(_scaled, CompileOptions(install="box[fast]"))


# --------------------------------------------------------------------------------------------- cache on disk


COMPOSE = """
    import sys
    from graspsense.simulator_api import CompileOptions, bind, compile_function

    part = None

    def soft(x):
        return 1.0 * x

    def hard(x):
        return 5.0 * x

    def law(x, y):
        return part(x) / y

    laws = {
        "soft": (bind(law, part=soft), CompileOptions()),
        "hard": (bind(law, part=hard), CompileOptions()),
        "hard, numpy": (bind(law, part=hard), CompileOptions(error_model="numpy")),
    }
    for name in sys.argv[1:]:
        compiled = compile_function(*laws[name])
        value = compiled(100.0, 0.0 if "numpy" in name else 1.0)
        print(name, value, sum(compiled.stats.cache_hits.values()))
"""


CALLS_LAW = """
    import sys, shapes
    from law import law
    from graspsense.simulator_api import compile_function
    compiled = compile_function(law)
    print(compiled(getattr(shapes, sys.argv[1])(3.0)), sum(compiled.stats.cache_hits.values()))
"""


def run(program, *arguments, **environment):
    done = python(program, *arguments, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment})
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def write(folder, **modules):
    """Write these modules into a folder, and return the file of the first one."""
    folder.mkdir(exist_ok=True)
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(textwrap.dedent(text))
    return folder / f"{next(iter(modules))}.py"


ASKS = """
    import sys
    sys.argv[1:] = []
    from compose import laws
    from graspsense.simulator_api import is_on_disk
    print([is_on_disk(*law) for law in laws.values()], "numba" in sys.modules)
"""


@pytest.mark.slow
def test_compositions_compiled_in_three_processes_stay_themselves_in_a_fourth(tmp_path):
    # Same functions, same types, other parts or other options: under one name, one would run the code of another.
    source = tmp_path / "source"
    program = write(source, program="import compose\n", compose=COMPOSE, asks=ASKS)
    asks = source / "asks.py"
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "NUMBA_CACHE_DIR": ""}

    assert run(asks, **cache) == ["[False, False, False] False"]
    assert run(program, "soft", **cache) == ["soft 100.0 0"]
    assert run(program, "hard", **cache) == ["hard 500.0 0"]
    assert run(asks, **cache) == ["[True, True, False] False"]
    assert run(program, "hard, numpy", **cache) == ["hard, numpy inf 0"]
    assert run(program, "soft", "hard", "hard, numpy", **cache) == [
        "soft 100.0 1",
        "hard 500.0 1",
        "hard, numpy inf 1",
    ]
    # It is kept in the user's cache and nowhere else.
    assert list((tmp_path / "cache" / "graspsense" / "compiled").rglob("*.nbc"))
    assert sorted(path.name for path in source.iterdir()) == ["asks.py", "compose.py", "program.py"]


@pytest.mark.slow
def test_an_edited_helper_or_constant_of_another_module_is_noticed(tmp_path):
    # numba itself looks at the file of the outermost function alone.
    law = "import scales\nfrom helpers import helper\n\ndef law(x):\n    return helper(x) * scales.SCALE\n"
    helper = "def helper(x):\n    return {} * x\n"
    told = []
    for factor, scale in ((2.0, 1.0), (2.0, 1.0), (3.0, 1.0), (3.0, 7.0)):
        others = {
            "helpers": helper.format(factor),
            "scales": f"SCALE = {scale}\n",
            "shapes": "number = float\n",
        }
        main = write(tmp_path, main=CALLS_LAW, law=law, **others)
        told += run(main, "number", NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert told == ["6.0 0", "6.0 1", "9.0 0", "63.0 0"]


@pytest.mark.slow
def test_code_of_a_version_with_other_types_is_made_anew(tmp_path):
    """The code of the function stays the same, but the type of its argument has another name."""
    shape = "from typing import NamedTuple\n\nclass {}(NamedTuple):\n    stiffness: float\n"
    law = "def law(params):\n    return params.stiffness * 2.0\n"
    told = []
    for name in ("Spring", "Spring", "Shell", "Shell"):
        program = write(tmp_path, program=CALLS_LAW, law=law, shapes=shape.format(name))
        told += run(program, name, NUMBA_CACHE_DIR=str(tmp_path / "kept"))
    assert told == ["6.0 0", "6.0 1", "6.0 0", "6.0 1"]


@pytest.fixture
def kept_in(tmp_path, monkeypatch):
    """A folder of its own for the code that this process keeps."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    compiled_code_folder.cache_clear()
    yield tmp_path
    compiled_code_folder.cache_clear()


def test_what_was_interrupted_while_it_was_compiled_is_compiled_again(kept_in, monkeypatch):
    monkeypatch.setattr(compiling, "_COMPILED", {})
    compiled = compile_function(bind(_scaled, helper=_thrice))

    def interrupted(*given):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(compiling, "copies_if_inlined", interrupted)
        with pytest.raises(KeyboardInterrupt):
            compiled(2.0)
    assert compiled(2.0) == 12.0


def test_a_called_function_that_is_replaced_before_the_first_call_is_not_kept_under_the_old_name(
    kept_in, monkeypatch
):
    monkeypatch.setattr(compiling, "_COMPILED", {})
    law = bind(_scaled, helper=_twice)
    compiled = compile_function(law)
    law.__globals__["helper"] = _thrice
    with pytest.raises(NotCompilable, match=r"test_compiling\._scaled.*`compile_function`"):
        compiled(2.0)
    assert compile_function(law)(2.0) == 12.0


def test_the_older_half_of_the_compiled_code_is_deleted_where_there_is_much(tmp_path):
    for i in range(6):
        (tmp_path / f"{i}").touch()
        os.utime(tmp_path / f"{i}", (i, i))

    delete_older_half(tmp_path, 7)
    assert len(list(tmp_path.iterdir())) == 6
    delete_older_half(tmp_path, 6)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["3", "4", "5"]


def test_a_user_without_a_home_has_no_folder_for_compiled_code(monkeypatch):
    monkeypatch.setattr(folder_module, "cache_folder", lambda: None)
    compiled_code_folder.cache_clear()
    assert compiled_code_folder() is None
    compiled_code_folder.cache_clear()


def test_nothing_is_compiled_where_numba_is_switched_off(monkeypatch):
    monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
    with pytest.raises(NotCompilable, match="NUMBA_DISABLE_JIT"):
        compile_function(_twice)
