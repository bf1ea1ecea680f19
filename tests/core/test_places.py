"""Where an error arose is told by a line of the plugin, also where the standard library called it."""

from functools import cached_property
from pathlib import Path

import pytest

from graspsense.core.values.errors import place_of


class Reading:
    @cached_property
    def force_n(self):
        return 1.0 / 0.0


def test_the_place_of_an_error_is_in_the_plugin_and_not_in_what_called_it():
    with pytest.raises(ZeroDivisionError) as error:
        _ = Reading().force_n

    error.value.__traceback__ = error.tb.tb_next  # from the standard library on
    assert place_of(error.value).startswith(f" in core/{Path(__file__).name}:")
