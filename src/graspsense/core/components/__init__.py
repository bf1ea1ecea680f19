"""What a plugin is: roles, entries, hooks, settings, and the registry of plugins."""
