"""C4.5 decision trees, equal to Weka's J48 to the bit; importing this pulls in nothing else."""

from __future__ import annotations

__version__ = "0.1.0"
