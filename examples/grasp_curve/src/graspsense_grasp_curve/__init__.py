"""Features of a grasp beyond the six of Table I."""
