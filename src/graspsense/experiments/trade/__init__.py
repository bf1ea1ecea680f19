"""Recognition against what it costs: seconds, force, speed, squeezes, sensing, the physics' accuracy."""
