"""The control loop as pure functions, which a simulator compiles: the tick, the guard, contact and rest."""
