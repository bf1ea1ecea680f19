"""Integration in time: the scheme, its step control and events, and the loop that advances the plant by a tick."""
