"""What importing costs: measured in fresh interpreters."""

import json

import pytest
from commands import python

from graspsense_c45 import Attribute, Schema, fit, make_table, to_json


def modules_after(code, *arguments):
    listed = code + "\nimport json, sys\nprint(json.dumps(sorted(m.split('.')[0] for m in sys.modules)))"
    done = python("-c", listed, *arguments, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_importing_the_package_imports_nothing_heavy():
    loaded = modules_after("import graspsense_c45; dir(graspsense_c45)")
    assert "graspsense_c45" in loaded
    assert not loaded & {"numpy", "sklearn", "numba", "pandas", "matplotlib", "graspsense"}


def test_a_stored_tree_predicts_with_numpy_alone():
    table = make_table(Schema((Attribute("x"),), ("a", "b")), [[0.0]] * 3 + [[1.0]] * 3, [0] * 3 + [1] * 3)
    code = (
        "import sys\nfrom graspsense_c45 import class_indices, explain, fit, from_json, to_text\n"
        "tree = from_json(sys.argv[1])\n"
        "assert class_indices(tree, [[0.0], [1.0]]).tolist() == [0, 1]\n"
        "assert 'x 1 > 0' in str(explain(tree, [1.0])), str(explain(tree, [1.0]))\n"
        "assert to_text(tree)"
    )
    loaded = modules_after(code, to_json(fit(table)))
    assert "numpy" in loaded
    assert not loaded & {"sklearn", "scipy", "numba", "pandas", "matplotlib", "graspsense"}


@pytest.mark.parametrize("missing", ["numba", "graspsense"])
def test_where_nothing_can_be_compiled_the_plain_form_answers(missing):
    code = (
        "import sys, importlib.util\n"
        "found = importlib.util.find_spec\n"
        "importlib.util.find_spec = lambda name: None if name == sys.argv[1] else found(name)\n"
        "from graspsense_c45.engines import Fits, missing_for_fast\n"
        "assert missing_for_fast() == (sys.argv[1],)\n"
        "assert not Fits().choose_fast('auto', 10**9, True)\n"
        "try:\n"
        "    Fits().choose_fast('fast', 1, True)\n"
        "except ModuleNotFoundError as error:\n"
        "    assert sys.argv[1] in str(error) and 'graspsense-c45[fast]' in str(error)\n"
        "else:\n"
        "    raise AssertionError\n"
    )
    assert not modules_after(code, missing) & {"numba", "graspsense"}


def test_every_public_name_loads_and_others_do_not():
    import graspsense_c45

    for name in graspsense_c45.__all__:
        assert getattr(graspsense_c45, name) is not None
    with pytest.raises(AttributeError, match="'tree_of_life'"):
        _ = graspsense_c45.tree_of_life
