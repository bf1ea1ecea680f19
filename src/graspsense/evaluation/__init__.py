"""How good a classifier is on labelled trials, and how much of that is the recording's rather than the object's."""
