"""Recordings of other programs that a manifest describes: files, labels, columns, and how they become grasps."""
