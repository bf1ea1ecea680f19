"""Components that work together: checked, from a file, and while a grasp goes on."""
