"""An emulated arm: six motors on a bus, of which the simulator moves that of the gripper."""
