"""The steps that meet an accuracy: their selection, their verification and their cache."""
