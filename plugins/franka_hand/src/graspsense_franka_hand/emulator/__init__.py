"""The hand in software, in the same process or behind its network protocol."""
