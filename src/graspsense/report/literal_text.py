"""Text in pictures as it is: a `$` in a label begins no formula, which matplotlib would typeset or refuse."""

from __future__ import annotations

from typing import Any


def show_literally(figure: Any) -> None:
    """Let a figure of matplotlib show its texts as they are, but for the powers at logarithmic axes."""
    from matplotlib.text import Text

    powers = {
        id(label)
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        if axis.get_scale() == "log"
        for label in axis.get_ticklabels(which="both")
    }
    for text in figure.findobj(Text):
        if id(text) not in powers:
            text.set_parse_math(False)
