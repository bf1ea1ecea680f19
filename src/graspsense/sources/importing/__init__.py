"""What `graspsense import` does: which recordings are named, what was understood of them, and how they are stored."""
