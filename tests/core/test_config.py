"""Settings: layers, origins, strictness, and every error at once."""

from __future__ import annotations

import json
import re
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Literal

import pytest
from attrs import asdict, evolve, field, frozen
from attrs.validators import ge, gt
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st
from parts import NoKeys, implementing, offering

from graspsense.core.components.caller import command_line
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.files.toml_text import key_lines, toml_key, toml_value
from graspsense.core.settings.layers import Flag, Layer
from graspsense.core.settings.resolved import resolve
from graspsense.core.settings.selected import build, create, recipe_of
from graspsense.core.settings.settings_file import to_toml
from graspsense.core.values.errors import ConfigError, UnknownName
from graspsense.plugin_api import ClassifierEntry, ControllerEntry, FeatureSetEntry, SensorBackendEntry


@frozen
class Filter:
    cutoff_hz: float = field(default=50.0, validator=gt(0.0))
    order: int = 2


@frozen(kw_only=True)
class Hand:
    port: str
    rate_hz: float = field(default=100.0, validator=gt(0.0))
    retries: int = 3
    echo: bool = False
    transport: Literal["usb", "emulated"] = "usb"
    offsets_n: tuple[float, ...] = ()
    serial: str | None = None
    gains: dict[str, float] = field(factory=dict)
    log: Path | None = None
    filter: Filter = Filter()


@frozen
class Other:
    transport: Literal["tcp", "emulated"] = "tcp"


@frozen
class Law:
    force_n: float = field(default=10.0, validator=ge(0.0))
    speed_m_s: float = field(default=0.01, validator=gt(0.0))
    low_n: float = field(default=0.0)

    @low_n.validator
    def _below(self, attribute, value):
        if value > self.force_n:
            raise ValueError(f"low_n {value} is above force_n {self.force_n}")


def entry(kind, name, config, **more):
    config = f"{config.__module__}:{config.__name__}"
    return kind(name=name, target="no_such_module:Nothing", config=config, summary=name, **more)


LAB_PARTS = offering(
    entry(SensorBackendEntry, "hand", Hand, channels=(), accepts=()),
    entry(SensorBackendEntry, "other", Other, channels=(), accepts=()),
    entry(ControllerEntry, "law", Law, requires=(), commands=()),
    entry(FeatureSetEntry, "none-at-all", NoKeys, requires=(), features=()),
)
GUESS = implementing("graspsense_classifiers", lambda self: [entry(ClassifierEntry, "guess", Law)])

BASE = """\
[gripper]
type = "hand"
port = "a"

[controller]
type = "law"
force_n = 12

[features]
type = "none-at-all"
"""


@pytest.fixture
def plugins():
    with IsolatedPlugins() as plugins:
        plugins.add(LAB_PARTS, "lab-parts", "0.3")
        plugins.add(GUESS, "lab-guess")
        yield plugins


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str, name: str = "lab.toml") -> str:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text)
        return name

    return write


def complaint(file, options=()) -> str:
    with command_line(), pytest.raises(ConfigError) as caught:
        resolve(file, options=options)
    return str(caught.value)


def test_later_layers_replace_lists_and_values_and_are_merged_with_tables(plugins, write):
    tried = {"offsets_n": [1, 2, 3], "filter": {"cutoff_hz": 5, "order": 1}}
    settings = resolve(
        write(BASE),
        experiment=Layer(label="experiment", values={"gripper": tried, "controller": {"speed_m_s": 0.5}}),
        options=["gripper.offsets_n=[9]", "gripper.filter.order=3", "controller.speed_m_s=0.02"],
        flags=[Flag("--speed", "controller.speed_m_s", 0.03)],
    )

    assert settings.gripper.config == Hand(port="a", offsets_n=(9.0,), filter=Filter(5.0, 3))
    law = {"type": "lab-parts/law", "force_n": 12.0, "speed_m_s": 0.03, "low_n": 0.0}
    assert settings.values["controller"] == law
    # A whole number is taken for a number and becomes one.
    assert type(settings.controller.config.force_n) is float
    assert settings.components["gripper"] == "lab-parts/hand 0.3"
    origins = {
        "gripper.type": "lab.toml:2",
        "gripper.offsets_n": "-o",
        "gripper.filter.cutoff_hz": "experiment",
        "controller.force_n": "lab.toml:7",
        "controller.speed_m_s": "--speed",
        "run.seed": "default",
    }
    assert {key: settings.origins[key] for key in origins} == origins


def test_every_leaf_has_an_origin_and_every_origin_a_leaf(plugins, write):
    settings = resolve(write(BASE), options=["gripper.gains.left=2", "gripper.filter.order=4"])

    def leaves(values, path=()):
        for key, value in values.items():
            if isinstance(value, dict) and value:
                yield from leaves(value, (*path, key))
            else:
                yield ".".join((*path, key))

    assert sorted(settings.origins) == sorted(leaves(settings.values))
    assert settings.origins["gripper.gains.left"] == settings.origins["gripper.filter.order"] == "-o"


def test_a_table_that_a_value_replaced_leaves_no_origin_behind(plugins, write):
    write(BASE.replace('port = "a"', 'port = "a"\nfilter = { order = 4 }'), "base.toml")
    write('extends = "base.toml"\n[gripper]\nfilter = 3', "middle.toml")
    top = write('extends = "middle.toml"\n[gripper]\nfilter = { cutoff_hz = 5 }', "top.toml")

    settings = resolve(top)

    assert asdict(settings.gripper.config.filter) == {"cutoff_hz": 5.0, "order": 2}
    assert settings.origins["gripper.filter.cutoff_hz"] == "top.toml:3"
    assert settings.origins["gripper.filter.order"] == "default"


def test_extends_lays_a_file_over_another_with_paths_from_its_own_folder(plugins, write):
    write(BASE, "shared/base.toml")
    write('extends = "base.toml"\n[controller]\nforce_n = 13', "shared/middle.toml")
    top = write('extends = "shared/middle.toml"\n\n[controller]\nspeed_m_s = 0.5', "top.toml")

    settings = resolve(top)

    assert settings.controller.config == Law(13.0, 0.5)
    assert settings.origins["controller.force_n"] == "shared/middle.toml:3"
    assert settings.origins["controller.speed_m_s"] == "top.toml:4"
    assert settings.origins["gripper.port"] == "shared/base.toml:3"


OTHER = (Flag("--gripper", "gripper.type", "other"),)
MIDDLE = 'extends = "base.toml"\n[gripper]\ntype = "other"\ntransport = "emulated"'
EMULATED = {"type": "lab-parts/other", "transport": "emulated"}


@every_case(
    ("text", "options", "flags", "gripper"),
    [
        # Keys of the file's other component are dropped; options apply to the final type, whatever their order.
        (BASE, [], OTHER, {"type": "lab-parts/other", "transport": "tcp"}),
        (BASE, ["gripper.transport=emulated"], OTHER, EMULATED),
        # The same type under its qualified name keeps the keys.
        (BASE, [], [Flag("--gripper", "gripper.type", "lab-parts/hand")], {"port": "a"}),
        # A type that is given late takes the keys given before any type.
        (BASE.replace('type = "hand"\n', ""), ["gripper.type=hand"], [], {"port": "a"}),
        # A file that changes the type starts afresh, and one that does not inherits.
        ('extends = "middle.toml"\n[run]\nseed = 4', [], [], EMULATED),
    ],
)
def test_a_change_of_type(plugins, write, text, options, flags, gripper):
    write(BASE, "base.toml")
    write(MIDDLE, "middle.toml")

    values = resolve(write(text), options=options, flags=flags).values["gripper"]

    assert {key: values[key] for key in gripper} == gripper
    assert ("port" in values) == ("port" in gripper)


def test_a_table_names_a_classifier_and_none_removes_it(plugins, write):
    text = BASE + '[classifier]\ntype = "guess"\nforce_n = 3\n'
    settings, removed = resolve(write(text)), resolve(write(text), options=["classifier.type=none"])

    assert settings.classifier.config.force_n == 3.0
    tables = [choice.component.table for choice in settings.chosen]
    assert tables == ["gripper", "controller", "features", "classifier"]
    assert removed.classifier is None
    assert "classifier" not in removed.values


def test_every_error_is_told_at_once_with_its_line(plugins, write):
    text = """\
[gripper]
type = "hand"
rate_hz = "100 Hz"
retries = 2.5
echo = "false"
transport = "ubs"
offsets_n = [1, "two", true]

[gripper.filter]
cutof_hz = 3

[controler]
type = "law"

[controller]
type = "law"
force_n = -1
speed_m_s = 0
forse_n = 3

[run]
seed = true
"""
    head, *told = complaint(write(text), options=["features.type=nosuch", "nonsense"]).splitlines()

    assert head.startswith("15 errors")
    expected = [
        ("-o nonsense", "expected TABLE.KEY=VALUE"),
        ("lab.toml:12: controler", "Did you mean 'controller'?"),
        ("lab.toml:1: gripper", "needs the key 'port'"),
        ("lab.toml:3: gripper.rate_hz", "found '100 Hz' (text): give the number alone"),
        ("lab.toml:4: gripper.retries", "expected a whole number, found 2.5"),
        ("lab.toml:5: gripper.echo", "expected true or false, found 'false' (text)"),
        ("lab.toml:6: gripper.transport", "expected one of 'usb', 'emulated', found 'ubs'"),
        ("lab.toml:7: gripper.offsets_n[1]", "expected a number, found 'two'"),
        ("lab.toml:7: gripper.offsets_n[2]", "expected a number, found true"),
        ("lab.toml:10: gripper.filter.cutof_hz", "Did you mean 'cutoff_hz'? It has: cutoff_hz, order"),
        ("lab.toml:19: controller.forse_n", "Did you mean 'force_n'?"),
        ("lab.toml:17: controller.force_n", "of at least 0, found -1.0"),
        ("lab.toml:18: controller.speed_m_s", "above 0, found 0.0"),
        ("-o features.type=nosuch", "no feature set named 'nosuch'. Known: catch22, "),
        ("lab.toml:22: run.seed", "expected a whole number, found true"),
    ]
    for line, (place, said) in zip(told, expected, strict=True):
        assert line.startswith(f"  {place}: ")
        assert said in line
    assert "\n".join(told).count("give the number alone") == 1


@every_case(
    ("text", "options", "says"),
    [
        ('extends = "defualt"', "", "lab.toml:1: .*'defualt'.*best, default.*'default'"),
        ("extends = 3", "", "lab.toml:1: extends: .*3"),
        ('extends = "b.toml"', "", "b.toml:2: extends .*lab.toml -> b.toml -> lab.toml"),
        (BASE, "gripper.typ=pr2", "'typ'.*'gripper.type'"),
        # A validator that looks at other keys keeps its words.
        (BASE, "controller.low_n=13", "-o controller.low_n=13: low_n 13.0 is above force_n 12.0"),
        (BASE, "gripper.type=other gripper.port=b", "'port'.* gripper.type = \"hand\""),
        (BASE, "classifier.type=none classifier.x=3", '-o classifier.x=3: classifier.type is "none"'),
        (BASE + "[classifier]\nforce_n = 3", "", "lab.toml:11: classifier.type"),
        ("", "", r"3 errors .*\n  gripper.type .*\n  "),
        ("[gripper]\ntype hand", "", "lab.toml:2, column 6: not TOML: .*'='"),
        ("a = 1\na = 2\n", "", "lab.toml:2, column 6: not TOML: "),
        ('a = """\n', "", "lab.toml:2: not TOML: "),
        ("a = " + "9" * 5000, "", "lab.toml:1: not TOML: .*4300 digits"),
        ("a = " + "[" * 50000, "", "lab.toml: .*too deep"),
    ],
)
def test_a_mistake_is_told_with_its_place(plugins, write, text, options, says):
    write('\nextends = "lab.toml"', "b.toml")
    told = complaint(write(text), options=options.split())
    assert re.search(says, told), told


@every_case(
    ("option", "said"),
    [
        ("gripper.retries=3.0", r"whole number.* 3\.0"),
        ("gripper.rate_hz=nan", " number.* nan"),
        ("gripper.echo=1", "true or false.* 1"),
        ("gripper.port=5", "text.* 5.*'KEY=\"...\"'"),
        ("gripper.port=2024-01-02", r"text.* 2024-01-02 \(a date\)"),
        ("gripper.offsets_n=abc", " list.*'abc'"),
        ("gripper.filter=3", " table.* 3"),
        ("gripper.gains={left = true}", " number.* true"),
        ("gripper.serial=4", " text.* 4"),
        ("gripper.type=3", " text.* 3"),
        ("gripper=other", 'gripper.type = "other"'),
        ("run=3", " table.* 3"),
        ("gripper.port.x=3", " text.* table"),
        ("gripper.port=\udcff", "UTF-8 text"),
    ],
)
def test_nothing_is_coerced(plugins, write, option, said):
    told = complaint(write(BASE), options=[option])

    assert re.match(re.escape(f"-o {option}: ") + ".*" + said, told), told
    # A date in quotes is no advice: nobody meant a text.
    assert not said.endswith("(a date)") or told.endswith(said)


@every_case(
    ("typed", "value"),
    [
        ("usb", "usb"),
        ('"17"', "17"),
        ("/dev/tty USB#0", "/dev/tty USB#0"),
        ("1 # not a comment", "1 # not a comment"),
        ("1\nretries = 7", "1\nretries = 7"),
        ("a=b", "a=b"),
        ("", ""),
    ],
)
def test_what_is_no_toml_value_is_text(plugins, write, typed, value):
    assert resolve(write(BASE), options=[f"gripper.port={typed}"]).gripper.config.port == value


@every_case(
    ("name", "says"),
    [
        ("defualt", "no pipeline named 'defualt'. Known: best, default. Did you mean 'default'?"),
        ("mine", "A file is given with its ending .toml; there is a file 'mine' without it: rename it"),
        ("yours", "A file is given with its ending .toml: yours.toml"),
        ("nosuch.toml", "no pipeline file 'nosuch.toml' in {here}"),
        ("x/y.toml", "no pipeline file 'x/y.toml' in {here}/x"),
        ("youres.toml", "Did you mean 'yours.toml'?"),
        ("z/y.toml", "no pipeline file 'z/y.toml': there is no folder '{here}/z'"),
        ("folder.toml", "cannot read the pipeline file 'folder.toml': Is a directory"),
        ("latin.toml", "latin.toml:2: not UTF-8 text (byte 0xff)"),
        ("ring.toml", "cannot read the pipeline file 'ring.toml'"),
    ],
)
def test_a_file_that_is_not_there_or_cannot_be_read_is_told(plugins, write, name, says):
    for existing in ("mine", "yours.toml", "x/y.txt", "folder.toml/inside"):
        write(BASE, existing)
    Path("latin.toml").write_bytes(b"[gripper]\nname = \xff\xfe\n")
    if not Path("ring.toml").is_symlink():
        Path("ring.toml").symlink_to("ring.toml")
    assert says.format(here=Path.cwd()) in complaint(name)


def test_a_byte_order_mark_and_windows_line_ends_are_no_matter(plugins, write):
    Path(write("")).write_bytes(("\ufeff" + BASE).replace("\n", "\r\n").encode())
    settings = resolve("lab.toml")
    assert settings.gripper.config.port == "a"
    assert settings.origins["controller.force_n"] == "lab.toml:7"


def test_create_makes_a_component_as_strictly_as_a_file(plugins):
    controller = create("controller", "hybrid", probing_force_n=17)
    assert controller.config.probing_force_n == 17.0
    with pytest.raises(ConfigError, match=r"^controller\.probing_forse_n: .*'probing_force_n'"):
        create("controller", "hybrid", probing_forse_n=17)
    with pytest.raises(UnknownName, match=r"'hybird'.*'hybrid'"):
        create("controller", "hybird")
    with pytest.raises(ConfigError, match="2 errors"):
        build(plugins.find("controller", "law"), {"force_n": -1, "speed_m_s": "x"})


def test_a_recipe_makes_the_same_component_again():
    with IsolatedPlugins():
        made = create("controller", "hybrid", probing_force_n=17)
        name, values = recipe_of("controller", made)
        again = create("controller", name, **json.loads(json.dumps(values)))
        assert name == "graspsense/hybrid"
        assert type(again) is type(made)
        assert again.config == made.config

        class Own(type(made)):
            """Of a script."""

        with pytest.raises(UnknownName, match=r"<locals>\.Own "):
            recipe_of("controller", Own(made.config))
        made.config = evolve(made.config, probing_force_n=Decimal(17))
        with pytest.raises(ConfigError, match="probing_force_n"):
            recipe_of("controller", made)


def test_settings_as_a_file_resolve_by_themselves_to_the_same_values(plugins, write):
    resolved = resolve(
        write(BASE),
        options=[
            'gripper.port="C:\\\\tty\\n\\u007f\\"x\\" ü 🤖"',
            "gripper.rate_hz=inf",
            "gripper.offsets_n=[0.1, 1e-300, -3]",
            'gripper.gains={ left = 2, "to the right" = 1 }',
            "gripper.log=out/run.log",
            "gripper.echo=true",
            "run.seed=7",
            "classifier.type=guess",
        ],
    )
    again = resolve(write(to_toml(resolved), "again.toml"))

    assert (again.values, again.run) == (resolved.values, resolved.run)
    assert {origin.partition(":")[0] for origin in again.origins.values()} == {"default", "again.toml"}
    assert to_toml(again).replace("again.toml", "lab.toml") == to_toml(resolved)


TEXT = st.text(st.characters(exclude_categories=["Cs"]))
PLAIN = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=12,
)
TABLES = st.dictionaries(TEXT, PLAIN, max_size=5)


@pytest.mark.slow
@given(TABLES)
def test_any_plain_value_survives_being_written_as_toml(values):
    text = "\n".join(f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items())

    assert tomllib.loads(text) == values


def paths(value, path=()):
    if isinstance(value, dict):
        for key, child in value.items():
            yield (*path, key)
            yield from paths(child, (*path, key))
    elif isinstance(value, list):
        for index, child in enumerate(value):
            yield (*path, index)
            yield from paths(child, (*path, index))


def test_lines_of_everything_that_toml_can_write():
    text = '''\
a.b."1" = 1 # [no]
2 = """
[not.a.table]
x = 1
"""
6 = \'\'\'it's
x = 1\'\'\'
8 = [ # one
  1, "]", # two
  { 10 = [3], m.10 = 4 },
]
[t . u]
13 = 1979-05-27 07:32:00
[[s]]
15 = 1
[[s]]
[s.t]
18 = 2
[[s.deep]]
[[s.deep]]
21 = { "" = 'end' }
'''
    lines = key_lines(text)

    assert set(lines) == set(paths(tomllib.loads(text)))
    # A key that is a number is that of its line.
    numbered = {
        path: line for path, line in lines.items() if str(path[-1]).isdigit() and isinstance(path[-1], str)
    }
    assert numbered == {path: int(path[-1]) for path in numbered}
    tables = {("a", "b"): 1, ("8", 1): 9, ("t", "u"): 12, ("s", 1): 16, ("s", 1, "deep", 1): 20}
    assert {path: lines[path] for path in tables} == tables
