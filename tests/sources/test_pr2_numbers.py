"""The published numbers of the PR2 gripper are the same in its driver, in the simulator and in the reader of its bags.

Each has them as data of its own, because none of them may import another: `graspsense_pr2_gripper.linkage`,
`graspsense_sim_gripper.plant.drive_models`, `sensing` and `fingertip`, `graspsense.sources.recordings.rosbag`.
"""

from __future__ import annotations

from graspsense.sources.recordings import rosbag
from graspsense_pr2_gripper import backend, fingertip, linkage
from graspsense_sim_gripper.plant import drive_models, sensing
from graspsense_sim_gripper.plant import fingertip as simulated_fingertip
from graspsense_sim_gripper.run import build


def test_linkages_are_the_same():
    simulated = {name: link for name, link in drive_models.LINKAGES.items() if name != "straight"}

    assert simulated == linkage.LINKAGES


def test_encoders_are_the_same():
    assert drive_models.ENCODER_TICKS == linkage.ENCODER_TICKS


def test_scales_of_the_cells_are_the_same():
    edges = linkage.edge_scale(linkage.SIDE_COUNTS_PER_N, linkage.EDGE_COUNTS_PER_N)

    assert sensing.PAD_COUNTS_PER_N == rosbag.PAD_COUNTS_PER_N == linkage.PAD_COUNTS_PER_N
    assert sensing.EDGE_COUNTS_PER_N == rosbag.EDGE_COUNTS_PER_N == edges


def test_cells_of_a_fingertip_are_the_same():
    assert simulated_fingertip.CELLS == rosbag.CELLS == fingertip.CELLS
    assert simulated_fingertip.FIRST_PAD_CELL == rosbag.FIRST_PAD_CELL == fingertip.FIRST_PAD_CELL


def test_a_tare_takes_the_same_number_of_images():
    assert build.TARE_IMAGES == rosbag.TARE_IMAGES == backend.TARE_IMAGES
