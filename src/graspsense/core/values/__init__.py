"""What passes between the parts: readings, commands, traces, features, predictions, trials, and their units."""
