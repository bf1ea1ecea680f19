"""Tables with one line per trial: features, labels, and columns that may reveal them."""
