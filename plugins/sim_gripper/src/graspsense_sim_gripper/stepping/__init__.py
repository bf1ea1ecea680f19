"""Integration in time: the schemes, their step control and events, and the loop that advances the plant by a tick."""
