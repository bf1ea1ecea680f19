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
