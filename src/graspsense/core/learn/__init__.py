"""Models: training data, certainty, prediction sets, novelty, and their files."""
