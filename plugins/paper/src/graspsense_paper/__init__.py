"""Comparison with Chitta, Piccoli and Sturm (ICRA 2010): published figures, ours, and which claims hold."""
