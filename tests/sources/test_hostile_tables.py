"""Tables, manifests and settings that were made to do harm: each is answered at once, in words that name the file."""

import numpy as np
import pytest
from cases import every_case
from commands import graspsense, refused
from repository import ROOT

from graspsense.core.components.channels import from_json
from graspsense.core.files.toml_text import MOST_NESTED, TomlError, toml_values
from graspsense.core.learn.target_value import name_and_unit
from graspsense.core.settings.layers import Layer, Merged, option_layers, read_toml
from graspsense.core.values import limits
from graspsense.core.values.errors import ConfigError, DataDamaged, suggestion
from graspsense.experiments.experiment_file import read_experiment
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.sources.formats.csv_columns import CsvColumns
from graspsense.sources.formats.patterns import PatternError, file_template, regular_expression, wildcard
from graspsense.sources.formats.text_format import read_text
from graspsense.sources.manifest.description import read_manifest
from graspsense.sources.manifest.expression import ExpressionError, parse
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense_c45.arff import ArffError, parse_arff
from graspsense_sim_gripper.scene.library import find

MANIFEST = 'files = "*.csv"\ntime = "t"\ngap = "g [mm]"\nforce = "F"\nlabel = "jar"\n'
GRASP = "t,g,F\n" + "".join(f"{k * 0.01:.2f},{60 - k},{max(0, k - 20)}\n" for k in range(50))


def manifest(folder, text, csv=GRASP):
    (folder / "grasp.csv").write_text(csv)
    path = folder / "manifest.toml"
    path.write_text(text)
    return path


def table(path, labels, features=1):
    """Write a table of features with these labels."""
    header = ",".join(["label", *(f"x{k}" for k in range(features))])
    rows = (f"{label}{f',{i % 7}' * features}" for i, label in enumerate(labels))
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


# Patterns


def test_a_pattern_that_backtracks_is_matched_in_linear_time():
    # Python's `re` would try 2^5000 ways.
    line = "a" * 5000 + "!"
    assert regular_expression("(a+)+$").search(line) is None
    assert regular_expression("((((a*)*)*)*)*$").search(line) is not None
    assert file_template("*a*a*a*a*a*a*a*a*a*a*.csv").fields("a" * 400) is None
    assert wildcard("*a*a*a*a*a*a*a*a*a*a*b").fullmatch("a" * 400) is None


def test_what_needs_backtracking_or_is_too_large_is_refused_with_the_reason(tmp_path):
    for pattern in (r"(\w)\1", "(?=x)y", "(?<!x)y", "(?P<a>x)(?P=a)", "(?>a)b", "a++"):
        path = manifest(tmp_path, MANIFEST + f"start = '{pattern}'\n")
        with pytest.raises(ConfigError, match=r"manifest\.toml:6: start.*not supported.*RE2"):
            read_manifest(path)
    for pattern in ("a{1000}{1000}", "x" * 1001, "(", "[z-a]"):
        with pytest.raises(PatternError):
            regular_expression(pattern)


@every_case(
    ("template", "path", "fields"),
    [
        ("{label}/{label}_{order:d}.csv", "jar/can_3.csv", None),
        ("{a}_{a}.csv", "x_y_x_y.csv", {"a": "x_y"}),  # the longest first text alone does not fit twice
        ("{label}/**/{label}_{rest}.csv", "jar/a/b/jar_1_2.csv", {"label": "jar", "rest": "1_2"}),
        ("**/{name}.c?v", "a/b/x.csv", {"name": "x"}),
        ("{name}.csv", "a/x.csv", None),
    ],
)
def test_a_template_reads_fields_from_a_path(template, path, fields):
    assert file_template(template).fields(path) == fields


def test_a_template_with_repeated_fields_tries_a_limited_number_of_values():
    with pytest.raises(PatternError, match="twice"):
        file_template("{a}{a}{b}{b}").fields("ab" * 60 + "c")
    with pytest.raises(PatternError, match="characters"):
        file_template("{a}{a}").fields("ab" * 300)


def test_wildcards_of_column_names():
    names = ["f1", "f2", "f12", "g1", "f*"]
    assert [name for name in names if wildcard("f?").fullmatch(name)] == ["f1", "f2", "f*"]
    assert [name for name in names if wildcard("f[12]*").fullmatch(name)] == ["f1", "f2", "f12"]
    assert [name for name in names if wildcard("[!f]*").fullmatch(name)] == ["g1"]


# Tables


def test_thousands_of_equal_column_names_are_numbered(tmp_path):
    path = tmp_path / "equal.csv"
    path.write_text("t," + ",".join(["x"] * 4000 + ["x.1"]) + "\n" + "1," * 4001 + "1\n")
    names = list(read_text(path)[0].numbers)
    assert len(names) == 4002
    assert names[1:4] == ["x", "x.1", "x.2"]


@every_case("read", [CsvColumns, read_text])
@every_case(
    ("limit", "text"),
    [
        (limits.TEXT_BYTES, "a,b,c\n" + "1,2,3\n" * 20),
        (limits.LINE_CHARACTERS, "a,b,c\n1,2,333333333333333333333\n1,2,3\n"),
        (limits.COLUMNS, ",".join("abcdefghijklm") + "\n" + ",".join("1234567890123") + "\n"),
        (limits.CELLS, "a,b,c\n" + "1,2,3\n" * 20),
    ],
)
def test_a_table_beyond_a_limit_is_damaged_and_the_limit_can_be_raised(
    tmp_path, monkeypatch, read, limit, text
):
    path = tmp_path / "table.csv"
    path.write_text(text)
    read(path)
    monkeypatch.setenv(limit.variable, "12")
    with pytest.raises(DataDamaged, match=rf"table\.csv.*{limit.what}.*{limit.variable}"):
        read(path)
    monkeypatch.setenv(limit.variable, "1000")
    read(path)


@every_case("given", ["0", "-1", "1e6", "lots", "9" * 40, "٣"])
def test_a_limit_that_is_not_a_number_is_refused_by_its_name(monkeypatch, given):
    monkeypatch.setenv(limits.COLUMNS.variable, given)
    with pytest.raises(ConfigError, match=limits.COLUMNS.variable):
        limits.COLUMNS.exceeded(1)


def test_every_limit_is_documented():
    page = (ROOT / "docs" / "import.md").read_text()
    for limit in (value for value in vars(limits).values() if isinstance(value, limits.SizeLimit)):
        assert f"`{limit.variable}`" in page
        assert f"{limit.default:,}".replace(",", " ") in page


@every_case(
    "data",
    [
        b"label,x\na,\x001\n",
        "label,x\na,1\n".encode("utf-16")[:-1],
        "label,x\na,1\n".encode("utf-32")[:-1],
        "label,x\nж,1\n".encode("cp1251"),
        b'label,x\na,"' + b"1" * 200_000 + b'"\n',
        b"",
        b"label,x\na,1e400\nb,2\na,3\nb,4\n",
        b"label," + b"x" * 600 + b"\na,1\n",
    ],
)
def test_a_table_that_is_none_names_the_file(tmp_path, data):
    path = tmp_path / "table.csv"
    path.write_bytes(data)
    with pytest.raises((DataDamaged, ConfigError), match=r"table\.csv") as refused:
        read_labelled(path, "label")
    assert len(str(refused.value)) < 1000
    for command in (("evaluate",), ("train", "--out", tmp_path / "model.json")):
        assert graspsense(*command, path, "--label", "label").returncode in (2, 5)


@every_case("end", ["\n", "\r", "\r\n"])
def test_a_long_text_of_short_lines_is_read(tmp_path, monkeypatch, end):
    monkeypatch.setenv(limits.LINE_CHARACTERS.variable, "10")
    path = tmp_path / "lines.csv"
    path.write_bytes(f"t g F{end}".encode() + f"1 2 3{end}".encode() * 50)
    assert len(read_text(path)[0]) == 50
    path.write_bytes(path.read_bytes() + f"{'1' * 20} 2 3{end}".encode())
    with pytest.raises(DataDamaged, match="line 52"):
        read_text(path)


def test_long_texts_take_linear_time(tmp_path):
    # No suggestion is sought for a text that is no name.
    assert suggestion("x" * 100_000, ["x" * 99_999]) == ""
    assert "'width'" in suggestion("widht", ["width", "y" * 100_000])
    # Headings of many brackets, a cell of many digits, many keys, and a long row of ARFF.
    assert name_and_unit("[" * 100_000 + "x]")[1] == "x"
    assert name_and_unit(" " * 100_000 + "x")[1] == ""
    assert name_and_unit("a [b] c [N]") == ("a [b] c", "N")
    assert name_and_unit("a]b]") == ("a]b]", "")
    path = tmp_path / "digits.csv"
    path.write_text(f"a b c\n{'1' * 300_000}x 1 1\n0 1 2\n")
    assert "a" in read_text(path)[0].texts
    merged = Merged()
    layer = Layer(label="file", values={"table": {f"k{i}": i for i in range(20_000)}})
    merged.add((), layer.values, layer)
    assert merged.owner_of(("table", "k7")) is layer
    merged.add((), {"table": 3}, layer)
    assert merged.owner.keys() == {(), ("table",)}
    values = ", ".join(f"v{k}" for k in range(9000))
    head = f"@relation r\n@attribute a {{{values}}}\n@attribute label {{x, y}}\n@data\n"
    assert len(parse_arff(head + "v1, x\nv8999, y\n").labels) == 2
    with pytest.raises(ArffError, match="values"):
        parse_arff(head + "v1, " * 20_000 + "x\n")


# Classes and features


@pytest.mark.slow
def test_as_many_labels_as_half_of_the_trials_are_refused_by_every_command(tmp_path):
    """The limit is that of the table, whatever learns from it; each command reads the table in its own way."""
    path = table(tmp_path / "table.csv", [f"c{i // 2}" for i in range(1000)])
    for command in (
        ("evaluate", path),
        ("train", path, "--out", tmp_path / "model.json"),
        ("compare", path, "--classifiers", "c45,ebm,forest,svm,knn,mlp,boosted,tree"),
    ):
        err = refused(*command, "--label", "label")
        assert "500 different labels" in err
        assert limits.CLASSES.variable in err


@every_case(
    "option",
    [
        ("--checkpoints", ",".join(map(str, range(1, 9000)))),
        *(("--seed", seed) for seed in ("-1", str(2**63), "9" * 30)),
    ],
)
def test_thousands_of_features_or_checkpoints_and_a_seed_out_of_range_are_wrong_use(
    tmp_path, monkeypatch, option
):
    path = table(tmp_path / "table.csv", ["a", "b"] * 20)
    refused("evaluate", path, "--label", "label", *option)
    monkeypatch.setenv(limits.FEATURES.variable, "50")
    path = table(tmp_path / "table.csv", ["a", "b"] * 4, features=51)
    assert limits.FEATURES.variable in refused("evaluate", path, "--label", "label", "--classifier", "ebm")


# TOML


@every_case(
    "text",
    [
        "x = " + "[" * (MOST_NESTED + 1) + "]" * (MOST_NESTED + 1),
        "a." * 100_000 + "a = 1",
        "[" + "a." * 5000 + "a]",
        "x = " + "{a = " * 3000 + "1" + "}" * 3000,
        "x = 9223372036854775808",
        "x = 0x" + "f" * 100_000,
        "x = 1\nx = 2",
        "#" * (limits.SETTINGS_BYTES.default + 1),
    ],
)
def test_toml_out_of_bounds_is_refused_at_once(tmp_path, text):
    with pytest.raises(TomlError):
        toml_values(text)
    path = tmp_path / "settings.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"settings\.toml"):
        read_toml(path, str(path), "configuration")


def test_every_command_refuses_toml_out_of_bounds(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("x = " + "[" * 5000 + "]" * 5000)
    for command in (
        ("run", "--pipeline", path),
        ("experiment", path),
        ("import", path, "--check"),
        ("run", "--object", path),
        ("identify", path, "--out", tmp_path / "out.toml"),
        ("evaluate", f"identified:{path}"),
    ):
        assert graspsense(*command).returncode == 2


def test_thousands_of_unknown_keys_are_told_in_a_few_lines(tmp_path):
    path = manifest(tmp_path, "".join(f"k{i} = 1\n" for i in range(2_000)))
    with pytest.raises(ConfigError, match="1980 more") as refused:
        read_manifest(path)
    assert len(str(refused.value).splitlines()) < 30


def test_the_largest_toml_is_read():
    nested = "x = " + "[" * (MOST_NESTED - 1) + "1" + "]" * (MOST_NESTED - 1)
    values = toml_values(
        f"{nested}\ny = -9223372036854775808\nz = [{'1.5, ' * 1000}1.5]\nw = '{'a.' * 1000}'"
    )
    assert values["y"] == -(2**63)


@every_case("value", ["0x" + "f" * 9999, "9" * 5000, str(2**63), "[" * 3000, "a." * 3000])
def test_an_option_out_of_bounds_is_wrong_use(value):
    option_layers([f"run.seed={value}"])
    refused("run", "-o", f"run.seed={value}")


@every_case(
    "key",
    [
        f'zero = "{"9" * 5000} samples"',
        "rate_hz = 1e308",
        "channels = {" + ", ".join(f'k{i} = "F"' for i in range(501)) + "}",
        'folder = "~nobody_of_this_name/x"',
        'folder = "a\\u0000b"',
        'recorded = "1e308"',
    ],
)
def test_a_key_of_a_manifest_out_of_bounds_is_answered(tmp_path, key):
    path = manifest(tmp_path, MANIFEST + key + "\n")
    try:
        answers = list(read_recordings(str(path)))
    except ConfigError as error:
        answers = [error]
    assert len(answers) == 1
    assert not isinstance(answers[0], ConfigError) or "manifest.toml" in str(answers[0])


TOO_MANY_ROWS = "t,g,F\n" + "".join(f"{k},60,1\n" for k in range(limits.RECORDINGS.default + 1))


@pytest.mark.slow
@every_case(
    ("text", "csv", "says"),
    [
        *(
            (f"{MANIFEST}resample_hz = {rate_hz}\n", GRASP, limits.SAMPLES.variable)
            for rate_hz in ("1e9", "1e300", "9223372036854775807")
        ),
        *(
            (f'{MANIFEST}split = "{split}"\n', TOO_MANY_ROWS, limits.RECORDINGS.variable)
            for split in ("rows", "t")
        ),
        (MANIFEST.replace('"F"', '"F/0"'), GRASP, "no number"),
    ],
)
def test_too_many_samples_or_grasps_or_no_force_are_refused_for_the_recording(tmp_path, text, csv, says):
    (recording,) = read_recordings(str(manifest(tmp_path, text, csv)))
    assert isinstance(recording, UnreadableRecording)
    assert says in str(recording.error)


@pytest.mark.slow
@every_case(
    "text",
    [
        "[data]\ntotal = 9223372036854775807",
        "[data]\ninstances = 9223372036854775807",
        "[data]\ninstances = 1000\ntrials = 1000000",
        "[[data.groups]]\ntotal = 1000000\n" * 1001,
        "[data.named]\n" + "".join(f'k{i} = "can:full_open"\n' for i in range(2_000)),
        "[data]\ncheckpoints_s = [" + ", ".join(str(k) for k in range(1, 2000)) + "]\n[judge]\nfolds = 1",
        "seeds = 9223372036854775807",
        "[sweep]\n" + "".join(f'"controller.k{i}" = [1, 2, 3, 4, 5, 6, 7, 8]\n' for i in range(40)),
        "".join(f'[[variants]]\nname = "v{i}"\n' for i in range(1001)),
        "pipelines = [" + '"default", ' * 1001 + "]",
        "classifiers = [" + '"tree", ' * 1001 + "]",
        "parts = [" + '"probing_force", ' * 1001 + "]",
        "[judge]\nfolds = 9223372036854775807",
        'classifiers = [{ type = "forest", trees = 9223372036854775807 }]',
        'classifiers = [{ type = "c45", rep_folds = 9223372036854775807 }]',
        "[gripper]\npad_cells = 9223372036854775807",
    ],
)
def test_a_count_of_an_experiment_out_of_bounds_is_refused_before_anything_is_made(tmp_path, text):
    path = tmp_path / "experiment.toml"
    path.write_text(f'title = "x"\n{text}\n')
    with pytest.raises(ConfigError):
        read_experiment(str(path))


def test_a_scene_with_thousands_of_terms_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("width_m = 0.05\n" + "[[terms]]\ntype = 'maxwell'\nk_n_m = 1\ntau_s = 1\n" * 2000)
    with pytest.raises(ConfigError, match=r"scene\.toml.*2000 terms"):
        find(str(path))


def test_a_channel_of_a_file_has_a_bounded_size():
    for channel in (
        {"kind": "array", "name": "a", "unit": "N", "finger": "x", "rows": 10**9, "columns": 10**9},
        {"kind": "fast", "name": "a", "unit": "N", "rate_hz": 1.0, "samples": 10**12, "axes": ["x"]},
    ):
        with pytest.raises(ValueError, match=limits.CHANNEL_NUMBERS.variable):
            from_json(channel)


# Expressions


@every_case(
    "text",
    [
        "9**9**9", "F**2", "1<<9999999", "9" * 1000, "0x" + "f" * 1900, "1e999*F", "1j*F", "(" * 900 + "F" + ")" * 900,
        "-" * 1900 + "F", "F" + "*1" * 200, "F.__class__", "lambda: 0", "f'{F}'", "[x for x in F]", "F\0", "x" * 2001,
        "open('x')", "__import__('os').system('true')", "F[F]",
        "F or F", "(F := 1)", "print(F)", "max(*F)", "max(F, key=F)", "F[-1]", "F[0:9]", "F['a']", "a" + " [" * 900,
    ],
)  # fmt: skip
def test_an_expression_that_is_out_of_bounds_is_refused(text):
    with pytest.raises(ExpressionError):
        parse(text)


def test_an_expression_over_more_cells_than_the_limit_is_refused(monkeypatch):
    monkeypatch.setenv(limits.CELLS.variable, "100")
    columns = {f"f{k}": np.zeros(10) for k in range(9)}
    assert parse("sum('*')").numbers(columns, 10).shape == (10,)
    with pytest.raises(ExpressionError, match=limits.CELLS.variable):
        parse("sum('*', '*')").numbers(columns, 10)


# ARFF


@every_case(
    "text",
    [
        "@attribute a {" + ", ".join(f"v{k}" for k in range(20_000)) + "}\n@data\nv1\n",
        "".join(f"@attribute a{k} numeric\n" for k in range(20_000)),
        "@attribute a numeric\n@attribute l {x}\n@data\n{" + "9" * 5000 + " 1}\n",
        "@attribute a numeric\n@attribute l {x}\n@data\n{² 1}\n",
        "@attribute a numeric\n@attribute l {x}\n@data\n" + "y" * 100_000 + ", x\n",
    ],
)
def test_arff_out_of_bounds_is_told_with_its_line(text):
    with pytest.raises(ArffError, match=r"<text>:\d+") as refused:
        parse_arff(text)
    assert len(str(refused.value)) < 2000
