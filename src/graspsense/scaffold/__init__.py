"""Packages to start a plugin from."""
