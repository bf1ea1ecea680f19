"""The published numbers of the PR2 gripper are the same in its driver, in the simulator and in the reader of its bags.

Each has them as data of its own, because none of them may import another: `graspsense_pr2_gripper.linkage`,
`graspsense_sim_gripper.plant.drive_models`, `sensing` and `fingertip`, `graspsense.sources.recordings.rosbag`.
"""

from graspsense.sources.recordings import rosbag
from graspsense_pr2_gripper import backend, fingertip, linkage
from graspsense_sim_gripper.plant import drive_models, sensing
from graspsense_sim_gripper.plant import fingertip as simulated_fingertip
from graspsense_sim_gripper.run import build


def test_the_published_numbers_are_the_same():
    simulated = {name: link for name, link in drive_models.LINKAGES.items() if name != "straight"}
    edges = linkage.edge_scale(linkage.SIDE_COUNTS_PER_N, linkage.EDGE_COUNTS_PER_N)
    tip = simulated_fingertip

    assert simulated == linkage.LINKAGES
    assert drive_models.ENCODER_TICKS == linkage.ENCODER_TICKS
    assert sensing.PAD_COUNTS_PER_N == rosbag.PAD_COUNTS_PER_N == linkage.PAD_COUNTS_PER_N
    assert sensing.EDGE_COUNTS_PER_N == rosbag.EDGE_COUNTS_PER_N == edges
    assert tip.CELLS == rosbag.CELLS == fingertip.CELLS
    assert tip.FIRST_PAD_CELL == rosbag.FIRST_PAD_CELL == fingertip.FIRST_PAD_CELL
    assert build.TARE_IMAGES == rosbag.TARE_IMAGES == backend.TARE_IMAGES
