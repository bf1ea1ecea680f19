"""The settings of a run: from files, options and defaults to components, and written as a file."""
