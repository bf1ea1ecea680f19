"""Recognition rates against their cost: time, force, speed, squeezes, sensing, accuracy of the model."""
