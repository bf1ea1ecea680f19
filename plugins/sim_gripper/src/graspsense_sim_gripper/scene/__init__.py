"""The objects to grasp: what describes one, the catalogue of known objects, and one sampled instance."""
