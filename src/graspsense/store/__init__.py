"""The trial store: a SQLite file with one row per trial, beside the recordings of the trials."""
