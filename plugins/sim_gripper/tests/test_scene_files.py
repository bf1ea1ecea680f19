"""Scenes of one's own: read strictly, held fast or free, explained, and with terms of somebody else's."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from batches import run_many
from cases import every_case
from commands import answered, printed
from unverified import sample, unverified_setup

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import ConfigError, UnknownName, create, hookimpl
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.scene.library import find, shipped_scenes, split_number
from graspsense_sim_gripper.scene.terms import Term, registry

HYBRID = create("controller", "hybrid")
NEAR = SimConfig(fidelity="fixed", open_gap_m=0.062)
"""The fingers close from 2 mm away, in steps that no trial grasp has to verify."""

FIRST_TERM = "width_m = 0.05\n[[terms]]\ntype"
SPRING = '[[terms]]\ntype = "elastic"\nk1_n_m = '
BOTTLE = f'width_m = 0.06\n[[terms]]\ntype = "maxwell"\nk_n_m = 200.0\ntau_s = 0.3\n{SPRING}2000.0\n'


@pytest.fixture
def scene(tmp_path):
    def write(text, name="bottle"):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        return str(path)

    return write


def test_a_file_needs_no_more_than_a_width_and_its_terms(scene):
    spec = find(scene(f"\ufeff{BOTTLE}"))  # as some editors of Windows begin a text
    assert (spec.name, spec.width_m, spec.held) == ("bottle", 0.06, False)
    # In the canonical order, whatever the file's.
    assert [kind for kind, _ in spec.terms] == ["elastic", "maxwell"]


@pytest.mark.slow
def test_the_text_of_a_scene_is_grasped_like_its_file(scene):
    text, scenes = BOTTLE, [scene(BOTTLE), BOTTLE, f"{BOTTLE}#3"]
    from_file, from_text, other = run_many(NEAR, HYBRID, scenes, [5, 5, 5])
    assert from_text.trace.force_left_n.tolist() == from_file.trace.force_left_n.tolist()
    # It has no spread, so its third instance is the nominal one.
    assert other.outcome == from_text.outcome
    assert split_number(f"{text}#3") == (text, 3)
    assert split_number(f"{text}# a comment\n") == (f"{text}# a comment\n", None)


@pytest.mark.slow
def test_the_report_of_a_grasp_is_of_the_scene_as_it_was_then(scene, tmp_path):
    grasp, again = run_many(NEAR, HYBRID, [scene(BOTTLE)] * 2, [5, 5], traces=False)
    report = grasp.report()
    (tmp_path / "bottle.toml").unlink()
    assert again.report() == report
    assert report["true_peak_force_n"] > 1.0


def test_fixed_steps_are_not_verified():
    config = SimConfig(object=BOTTLE, fidelity="fixed", sensor="ideal")
    backend = SimBackend(config)
    backend.open(0)
    selection = backend.report()["selection"]
    decisions = {row["subject"]: row["decision"] for row in selection["decisions"]}
    assert decisions == {"steps": "by their error", "contact": "not examined"}
    assert selection["verified"] is None


def test_a_fidelity_that_drops_or_keeps_terms_is_refused():
    """A scene has the terms that it names. There is no other model of it."""
    with pytest.raises(ConfigError, match=r"fidelity.*scene.*reference.*fixed"):
        create("sensor-backend", "sim", fidelity="full")


SPREAD = """width_m = 0.06
[[terms]]
type = "elastic"
k1_n_m = 4000.0
[[terms]]
type = "fracture"
force_n = 6.0
spread = { force_n = 0.3 }
"""


def test_a_parameter_with_a_spread_varies_between_instances_and_alone():
    spec, without = find(SPREAD), find(SPREAD.replace("spread = { force_n = 0.3 }", ""))
    forces = [sample(spec, seed).terms[1].force_n for seed in range(500)]
    assert np.std(np.log(forces)) == pytest.approx(0.3, rel=0.07)
    assert np.median(forces) == pytest.approx(6.0, rel=0.05)
    assert sample(spec, None).terms[1].force_n == 6.0
    instance, other = (sample(each, 7, 3) for each in (spec, without))
    assert (instance.width_m, instance.offset_m) == (other.width_m, other.offset_m)
    assert instance.terms[0] == other.terms[0]
    # A numbered instance is the same in every trial.
    assert sample(spec, 8, 3).terms == instance.terms != sample(spec, None).terms


@every_case(
    ("terms", "says"),
    [
        ('type = "fracture"', "give force_n or compression_m"),
        ('type = "fracture"\nforce_n = 5.0\nleft = 2', "left = 2.*most 1"),
        ('type = "elastic"\nk1_n_m = 0\nk3_n_m3 = -1e6', "would pull"),
        ('type = "elastic"\nk1_n_m = 100\nk3_n_m3 = -1e12', r"least -1.48e\+07"),
        ('type = "elastic"\nk1_n_m = 1e308', r"k1_n_m: 1e\+308.*at most 1e\+20"),
        ('type = "maxwell"\nk_n_m = 1.0\ntau_s = 1e-200', "tau_s: 1e-200.*at least 1e-30"),
        ('type = "foam"\nforce_n = 1\nat_m = 0.01\nexponent = 50', "exponent = 50 is .*at most 20"),
        ('type = "foam"\nforce_n = 1\nat_m = 0.01\nexponent = 0.05', "exponent = 0.05 is .*at least 0.2"),
        ('type = "elastic"\nk1_n_m = -100', "k1_n_m: -100 is negative"),
        ('type = "elastic"\nk1_n_m = 100\nspread = { k = 1 }', "parameter 'k'"),
        ('type = "elastic"\nk1_n_m = 100\nspread = { k1_n_m = 5 }', "spread.k1_n_m: 5"),
        ('type = "elastic"\nk1_n_m = 100\nspread = 1', "write a table"),
        ('type = "fracture"\nforce_n=1\n[[terms]]\ntype = "fracture"\nforce_n=2', "can have one"),
    ],
)
def test_parameters_without_a_law_are_refused(terms, says):
    with pytest.raises(ConfigError, match=says):
        find(f"width_m = 0.06\n[[terms]]\n{terms}\n")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_every_shipped_scene_is_grasped_and_stays_steady(name):
    done = run_many(SimConfig(sensor="ideal"), HYBRID, [name], [0])[0]
    assert done.outcome.name == "STEADY"
    assert 10.0 < done.state.peak_n < 40.0


@every_case(
    ("text", "says"),
    [
        ("width_m = 0.2", "width_m: 0.2 m wide .* fingers open.*0.086 m"),
        ("width_m = 0.08\noffset_m = -0.02", "offset_m: .* needs 0.12 m"),
        ("width_m = -0.01", "width_m: -0.01 is negative"),
        ("width_m = 0.0", "'width_m' must be > 0"),
        ("width_m = nan", "width_m: nan"),
        ("width_m = inf", "width_m: inf"),
        ("width_m = '5 cm'", "width_m: '5 cm'"),
        ("width_m = true", "width_m: True"),
        ("patch = 'face'", "width_m: is missing"),
        ("width_m = 0.05\nheld = 1", "held: 1"),
        ("width_m = 0.05\nwidht_m = 0.05", "widht_m.*'width_m'"),
        ("width_m = 0.05\nterms = 3", r"table \[\[terms\]\] for each"),
        (f"{FIRST_TERM}='spring'", r"\[\[terms\]\] 1 \(spring\): no term 'spring'"),
        (f"{FIRST_TERM}='maxwell'\nk_n_m=1", r"\[\[terms\]\] 1 \(maxwell\): missing tau_s"),
        (f"{FIRST_TERM}='maxwell'\nk_n_m=1\ntau_s=0", r"\(maxwell\) tau_s:.*0"),
        (f"{FIRST_TERM}='loss'\ndamping_n_s_m=-1", r"\(loss\) damping_n_s_m: -1 is negative"),
        ("width_m = ", "not TOML"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_by_file_table_and_field(scene, text, says):
    with pytest.raises(ConfigError, match=f"bottle.toml(:1)?: .*{says}"):
        unverified_setup(SimConfig(), scene(text), 0)


@every_case(
    ("name", "error", "says"),
    [
        ("nope.toml", ConfigError, "file .*nope.toml"),
        ("spong", UnknownName, r"named 'spong'.*sponge.*'sponge'\?"),
        ("widht_m = 0.05\n", ConfigError, "memory: widht_m: no such"),
    ],
)
def test_a_file_that_is_not_there_and_a_name_or_text_that_is_none(name, error, says):
    with pytest.raises(error, match=says):
        find(name)


def test_a_bottle_with_a_deep_snap_stays_dented(scene):
    text = 'width_m = 0.06\n[[terms]]\ntype = "snap"\nk1_n_m = 1500.0\ncritical_m = 0.004\n'
    text += "drop_n = 8.0\nfall_m = 0.003\nk2_n_m = 3000.0\n"
    setup = unverified_setup(SimConfig(spread=False), scene(text), 0)
    move, body = plant_move(registry.laws_of(setup.kinds)), setup.state
    for tick in range(6000):
        body = move(setup.plant, body, 25.0 if tick < 3000 else -30.0, 1e-3)
        assert tick != 2999 or body.contact.left.force_n > 8.0
    assert body.contact.left.force_n == 0.0
    # On the second branch, where it crosses zero: 6 - 8 + 3000 (d - 0.007) = 0.
    assert body.contact.left.compression_m == pytest.approx(0.007 + 2.0 / 3000.0, rel=1e-3)


def explained(name, seed=0):
    return run_grasp(SimBackend(SimConfig(object=name, explain=True)), HYBRID, RunConfig(seed=seed))


@pytest.mark.slow
def test_the_explanation_adds_up_to_the_force_that_was_felt():
    grasp = explained("odwalla:full_closed", seed=3)
    model = grasp.report["model"]
    rows = {row["term"]: row for row in model["terms"]}
    assert list(rows) == ["elastic", "maxwell", "gas"]
    assert sum(row["at_peak_n"] for row in rows.values()) == pytest.approx(model["peak_n"], rel=1e-3)
    assert model["peak_n"] == pytest.approx(grasp.report["true_peak_force_n"], rel=1e-3)
    assert sum(row["share"] for row in rows.values()) == pytest.approx(1.0)
    assert rows["maxwell"]["rates"] == [{"what": "relaxes", "per_s": 2.5}]
    # A spring gives back what was put in; a branch that relaxes does not.
    # It separates within a tick, and what it returns in this tick is not counted.
    assert abs(rows["elastic"]["lost_j"]) < 2e-3 * rows["elastic"]["work_j"]
    assert rows["maxwell"]["lost_j"] > 0.2 * rows["maxwell"]["work_j"] > 0.0


@pytest.mark.slow
def test_the_explanation_leaves_out_what_happens_in_a_released_object():
    # Released, it springs back against its damper faster than a tick.
    model = explained("odwalla:full_open").report["model"]
    assert "loss" in {row["term"] for row in model["terms"]}
    for row in model["terms"]:
        assert abs(row["peak_n"]) < model["peak_n"]
        assert abs(row["lost_j"]) < 2.0 * model["peak_n"] * model["compression_m"]


@pytest.mark.slow
def test_run_explains_the_model_in_the_terminal_and_in_json():
    shown = printed("run", "--object", "leaking_bottle", "-o", "gripper.explain=true")
    table = shown[shown.index("model       peak force 1") :].splitlines()
    assert table[1].split()[:2] == ["TERM", "PEAK"]
    assert [line.split()[0] for line in table[2:4]] == ["elastic", "gas"]
    assert "relaxes in 5 s" in table[3]
    none = answered("run", "--object", "none", "--explain-model")
    assert none["report"]["model"] == {"touched": False, "terms": [], "without": []}


# ---------------------------------------------------------------------------------- somebody else's term


class Gel(NamedTuple):
    k_n_m: float
    thickness_m: float
    limit_n: float


def gel(params, state, d0, d1, h, v1):
    """Return the force: a spring that would be infinitely stiff at its thickness; no number above a limit."""
    force = params.k_n_m * d1 * params.thickness_m / max(params.thickness_m - d1, 1e-6)
    return force if force < params.limit_n else math.nan, state


class Lab:
    GRASPSENSE_API = (2, 0)

    @staticmethod
    @hookimpl(optionalhook=True)
    def graspsense_sim_terms():
        yield Term(name="gel", summary="gel", params=Gel, law=gel, positive=("thickness_m",))


@pytest.fixture
def lab_terms():
    registry._foreign.cache_clear()
    with IsolatedPlugins() as plugins:
        plugins.add(Lab(), "lab-terms")
        yield
    registry._foreign.cache_clear()


GEL = f'{FIRST_TERM} = "gel"\nk_n_m = 1000.0\nthickness_m = 0.02\nlimit_n = 100.0\n{SPRING}500.0\n'


@pytest.mark.usefixtures("lab_terms")
@pytest.mark.slow
def test_a_term_of_another_distribution_is_composed_and_checked_like_ours():
    config = SimConfig(spread=False, sensor="ideal", open_gap_m=0.052)
    ill = GEL.replace("limit_n = 100.0", "limit_n = 5.0")
    assert find(GEL.replace('"gel"', '"lab-terms/gel"')).terms == find(GEL).terms
    with pytest.raises(ConfigError, match=r"\(gel\) thickness_m:.*0"):
        find(GEL.replace("0.02", "0.0"))
    (done,), (failed,) = (run_many(config, HYBRID, [scene], [0], compiled=False) for scene in (GEL, ill))
    assert (done.outcome.name, failed.outcome.name) == ("STEADY", "ABORTED")
    assert "term 'lab-terms/gel'" in failed.reason
    (fast,), (also,) = (run_many(config, HYBRID, [scene], [0], compiled=True) for scene in (GEL, ill))
    assert np.array_equal(fast.trace.gap_m, done.trace.gap_m)
    assert also.reason == failed.reason
