"""What holds for all tests here: none of them judges how fast this machine is."""

from hypothesis import HealthCheck, settings

# On top of what hypothesis itself chooses for a CI.
settings.register_profile(
    "any-machine", settings.default, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any-machine")
