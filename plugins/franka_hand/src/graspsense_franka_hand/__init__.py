"""The Franka Hand for graspsense."""
