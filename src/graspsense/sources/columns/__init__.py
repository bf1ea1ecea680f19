"""The columns of a grasp: time, gap, forces and further channels, in SI units, and what looks wrong in them."""
