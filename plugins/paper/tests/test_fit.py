"""The command that fits the catalogue's free figures again."""

import fit
import pytest

from graspsense_sim_gripper.scene.library import catalogue


def test_what_is_fitted_is_three_figures_of_each_of_four_containers():
    values = fit.fitted()
    assert {kind for kind, _ in values} == {"odwalla", "naked", "can", "water"}
    assert len(values) == 12
    assert values.keys() == fit.start().keys()
    assert values["can", "damping_n_s_m"] == 200.0
    # The scale and the unfitted spread stand in the reason; the value beside it is their product.
    for name, spec in catalogue().items():
        kind = name.partition(":")[0]
        if kind in fit.TRIALS:
            again = fit.with_figures(spec, *(values[kind, figure] for figure in fit.FIGURES))
            assert again.stiffness_spread == pytest.approx(spec.stiffness_spread, rel=1e-12)
            assert (again.share, again.terms) == (spec.share, spec.terms)


def test_the_splits_of_the_authors_tree():
    long, hit, deep, weak, other = (
        fit.Squeeze(0.6, 0.052, 7.0, 8.0),
        fit.Squeeze(0.3, 0.052, 7.0, 9.5),
        fit.Squeeze(0.3, 0.049, 7.0, 8.0),
        fit.Squeeze(0.3, 0.052, 5.0, 8.0),
        fit.Squeeze(0.3, 0.052, 7.0, 8.0),
    )
    states = ["full_open", "full_closed", "empty_open", "empty_open", "empty_closed"]
    sorted_by = fit.by_the_splits(states, (long, hit, deep, weak, other))
    # One of the two empty, open ones is deep and one is weak; the rest lies where it belongs.
    expected = {"tree_delta_t": 1.0, "tree_peak": 1.0, "tree_p_steady": 0.75, "tree_f_steady": 0.75}
    assert sorted_by == expected


def test_the_descent_finds_the_least_of_a_bowl_and_says_what_is_pinned():
    best = {("a", "x"): 3.0, ("b", "x"): 2.0}

    def cost(values):
        a, b = values["a", "x"] - 3.0, values["b", "x"] - 2.0
        return a * a + b * b + 0.5 * a * b

    begun = {("a", "x"): 0.0, ("b", "x"): 0.0, ("c", "x"): 7.0}
    descent = fit.descend(cost, begun, {"x": (0.0, 1.0, 2.0, 4.0, 8.0)}, 3)
    assert descent.values == {**best, ("c", "x"): 7.0}
    assert descent.cost == 0.0
    assert descent.pinned(("c", "x"), 1.0) == (0.0, 8.0)
    assert descent.pinned(("b", "x"), 0.25) == (2.0, 2.0)
