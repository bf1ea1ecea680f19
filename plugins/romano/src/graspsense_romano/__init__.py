"""Grasping by touch after Romano, Hsiao, Niemeyer, Chitta and Kuchenbecker (2011)."""
