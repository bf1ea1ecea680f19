"""The terms of an object's force, one file each; the forces of all terms of an object add up.

The law of a term is a pure function `law(params, state, d0, d1, h, v1) -> (force, state)`. The compression changes from
`d0` to `d1` (m) within `h` (s), with the rate `v1` (m/s) at the end; the law returns the force (N) and the state at the
end. A law integrates its own state over the step, so that a stiff state needs no small steps. It runs both in the
interpreter and compiled; parameters and states are named tuples of floats and integers. `Term` declares a term, and
`registry` finds it.
"""

from graspsense_sim_gripper.scene.terms.term import (
    Law,
    NoState,
    Rate,
    Term,
    WorkingPoint,
)

__all__ = ["Law", "NoState", "Rate", "Term", "WorkingPoint"]
