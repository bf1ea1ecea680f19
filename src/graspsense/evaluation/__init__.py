"""Evaluating classifiers on labelled trials, with controls that show how far a rate is due to the recording itself."""
