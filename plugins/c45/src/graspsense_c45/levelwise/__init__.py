"""The numpy engine: all nodes of a depth are grown, and pruned, together."""
