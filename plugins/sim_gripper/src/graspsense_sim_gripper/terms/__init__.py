"""What an object can be made of: terms that each add force when the object is compressed, one file each.

A term is a pure function `law(params, state, d0, d1, h, v1) -> (force, state)`: the compression goes from `d0` to
`d1` (m) in `h` (s) and moves at `v1` (m/s) by then; it returns the force (N) at the end and its state there. It
integrates itself over that piece of path, so that a stiff state of its own needs no small step. It runs in the
interpreter and compiled; parameters and states are named tuples of floats and integers. `Term` declares it;
`registry` knows them all.
"""

from graspsense_sim_gripper.terms.term import (
    Law,
    LinearForm,
    NoState,
    OwnContact,
    Rate,
    Term,
    WorkingPoint,
)

__all__ = ["Law", "LinearForm", "NoState", "OwnContact", "Rate", "Term", "WorkingPoint"]
