"""Chitta, Piccoli and Sturm (ICRA 2010) again: what they printed, what comes out here, and which claims hold."""
