"""Integration in time: schemes, step control, events, and the reference."""
