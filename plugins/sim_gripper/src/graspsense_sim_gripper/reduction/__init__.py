"""The reduced model of an object that meets an accuracy: its selection, its verification and their cache."""
