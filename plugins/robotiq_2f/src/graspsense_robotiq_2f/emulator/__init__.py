"""The grippers in software, behind a pseudo-terminal or a socket of this machine."""
