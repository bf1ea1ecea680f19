"""Figures and pages: the one owner of what is drawn."""
