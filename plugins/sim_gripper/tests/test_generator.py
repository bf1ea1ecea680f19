"""The random numbers of compiled grasps are those of numpy, to the bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_sim_gripper.run.compiled import drawing, generator
from graspsense_sim_gripper.run.compiled.drawing import compiled_drawing
from graspsense_sim_gripper.run.compiled.generator import (
    CompiledGenerator,
    compiled_generator,
    draws_like_numpy,
)
from graspsense_sim_gripper.scene.random_numbers import NumpyGenerator

pytest.importorskip("numba", reason="the compiled generator needs the extra `fast`")

SEEDS = st.one_of(
    st.integers(0, 1000),
    st.integers(0, 2**64 - 1),
    st.sampled_from([2**32 - 1, 2**32, 2**64 - 1, 2**64, 2**200 + 1]),
)


@given(SEEDS, st.lists(st.sampled_from(["normals", "table", "uniform", "copy"]), max_size=8))
def test_compiled_numbers_are_those_of_numpy_in_any_order_of_calls(seed, calls):
    rng, mine = np.random.default_rng(seed), compiled_generator()(seed)
    for call in calls:
        if call == "normals":
            assert mine.standard_normal(300).tolist() == rng.standard_normal(300).tolist()
        elif call == "table":
            table = np.zeros((6, 44))
            mine.fill(table)
            assert table.tolist() == rng.standard_normal((6, 44)).tolist()
        elif call == "uniform":
            assert mine.random() == rng.random()
        else:
            mine.copy().standard_normal(10)
            mine = mine.copy()


def test_millions_of_numbers_and_the_state_after_them_are_those_of_numpy():
    """The tail of the distribution begins at 3.65, where one number in 4000 lies."""
    mine, rng = compiled_generator()(3), np.random.default_rng(3)
    drawn, expected = mine.standard_normal(2_000_000), rng.standard_normal(2_000_000)
    assert np.array_equal(drawn, expected)
    assert np.abs(drawn).max() > 4.5
    assert mine.random() == rng.random()


def test_copies_of_both_generators_continue_alike_and_leave_the_first_as_it_was():
    for first in (NumpyGenerator(5), compiled_generator()(5)):
        first.standard_normal(7)
        copies = [first.copy().standard_normal(20).tolist() for _ in range(2)]
        assert copies[0] == copies[1] == first.standard_normal(20).tolist()


def test_a_negative_seed_is_refused_as_by_numpy():
    for generator_of in (NumpyGenerator, compiled_generator()):
        with pytest.raises(ValueError, match="non-negative"):
            generator_of(-1)


def test_numpy_draws_where_its_numbers_are_others(monkeypatch):
    """Another version of numpy may draw by other tables."""
    tables = generator.ziggurat_of_numpy()
    others = tables._replace(factors=tables.factors * (1.0 + 1e-15))
    assert isinstance(compiled_generator()(1), CompiledGenerator)
    monkeypatch.setattr(generator, "ziggurat_of_numpy", lambda: others)
    monkeypatch.setattr(generator, "draws_like_numpy", draws_like_numpy.__wrapped__)
    assert compiled_generator() is NumpyGenerator
    monkeypatch.setattr(drawing, "draws_like_numpy", draws_like_numpy.__wrapped__)
    assert compiled_drawing.__wrapped__() is None
