"""A page: one HTML file that loads nothing, for screen, phone, print and screen reader, in light and dark.

Its style is `page.css`. Its only script, `page.js`, sorts and filters tables, shows values under the pointer and
zooms pictures. Without the script a page is complete.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Collection, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import Final

from attrs import field, frozen

from graspsense import __version__


@frozen(kw_only=True)
class Section:
    """A part of a page: its heading, and its content as HTML."""

    id: str
    title: str
    body: str


@frozen(kw_only=True)
class Page:
    """A page. `headline` is the answer as a person would say it; without it, the title is the heading.

    `answer` has the answer in figures, and `beside` what must be read with it, as HTML.
    """

    kind: str
    title: str
    question: str = ""
    answer: str
    headline: str = ""
    beside: str = ""
    sections: tuple[Section, ...] = field(factory=tuple)

    def html(self) -> str:
        """Return the whole file."""
        links = "".join(
            f'<li><a href="#{section.id}">{escape(section.title)}</a></li>' for section in self.sections
        )
        sections = "".join(
            f'<section id="{section.id}" aria-labelledby="{section.id}-h">'
            f'<h2 id="{section.id}-h">{escape(section.title)}</h2>'
            f"{section.body}</section>"
            for section in self.sections
        )
        question = f'<p class="question">{inline(self.question)}</p>' if self.question else ""
        kind = f"{self.kind}: {self.title}" if self.headline else self.kind
        style, script = _resource("page.css"), _resource("page.js")
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        return (
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            # Nothing may be loaded, and only this script may run, whatever is in the names of trials.
            '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
            f"style-src 'unsafe-inline'; script-src 'sha256-{digest}'; img-src data:\">\n"
            f'<meta name="generator" content="graspsense {__version__}">\n'
            f"<title>{escape(self.title)} – graspsense</title>\n<style>{style}</style>\n</head>\n<body>\n"
            f'<header><p class="kind">{escape(kind)}</p>{question}<h1>{inline(self.headline or self.title)}</h1>'
            "</header>\n"
            f'<main>\n<section id="answer" class="answer" aria-labelledby="answer-h"><h2 id="answer-h">Answer</h2>'
            f'<p class="sentence">{inline(self.answer)}</p>{self.beside}</section>\n'
            f'<nav aria-label="On this page"><ul>{links}</ul></nav>\n{sections}\n</main>\n'
            f"<footer><p>Made by graspsense {__version__}. This page loads nothing from elsewhere. "
            '<span class="hint">A click on a heading sorts a table. Pictures show values under the pointer; drag '
            "across a part to enlarge it, and double-click to see the whole again.</span></p></footer>\n"
            f"<script>{script}</script>\n</body>\n</html>\n"
        )


def inline(text: str) -> str:
    """Return plain text as HTML; what is between backticks is shown as code."""
    return _CODE.sub(r"<code>\1</code>", escape(text))


_CODE: Final = re.compile("`([^`\n]+)`")


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{inline(text)}</p>"


def bullets(items: Sequence[str], kind: str = "") -> str:
    """Return a list of plain texts; an empty text if there are none."""
    marked_as = f' class="{kind}"' if kind else ""
    return f"<ul{marked_as}>{''.join(f'<li>{inline(item)}</li>' for item in items)}</ul>" if items else ""


def figure(picture: str, caption: str) -> str:
    """Return a picture with a caption of plain text."""
    return f"<figure>{picture}<figcaption>{inline(caption)}</figcaption></figure>"


def panels(figures: Sequence[str]) -> str:
    """Return figures side by side if there is room."""
    return f'<div class="panels">{"".join(figures)}</div>'


def pair(left: str, right: str) -> str:
    """Return two blocks side by side if there is room."""
    return f'<div class="pair"><div>{left}</div><div>{right}</div></div>'


def folded(summary: str, body: str) -> str:
    """Return a block that is shown when its summary is clicked, and in print."""
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def table(
    caption: str,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    numbers: int = 99,
    verdicts: Collection[int] = (),
    *,
    captioned: bool = True,
) -> str:
    """Return a table of plain texts, the first cell of a row its heading; columns from `numbers` on are numbers.

    Cells of the columns `verdicts` get a mark and a colour, if they are among the words of `VERDICTS`. The table can be
    sorted and filtered. It scrolls sideways if it is too wide, and on a phone each row stands by itself. Without
    `captioned`, the caption is for screen readers alone.
    """
    kinds = [' class="n"' if k >= numbers and k not in verdicts else "" for k in range(len(header))]
    head = "".join(
        f'<th scope="col"{kind}>{escape(name)}</th>' for name, kind in zip(header, kinds, strict=True)
    )
    body = "".join(
        "<tr>"
        + f'<th scope="row">{inline(row[0])}</th>'
        + "".join(
            f"<td{kinds[k]}>{marked(cell) if k in verdicts else inline(cell)}</td>"
            for k, cell in enumerate(row[1:], start=1)
        )
        + "</tr>"
        for row in rows
    )
    return wide(
        caption,
        f'<table class="rows"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>',
        captioned=captioned,
    )


VERDICTS: Final = {
    "agrees": ("✓", "good"),
    "yes": ("✓", "good"),
    "higher": ("▲", "good"),
    "differs": ("✗", "bad"),
    "no": ("✗", "bad"),
    "lower": ("▼", "bad"),
    "equivalent": ("✓", "good"),
    "worse": ("▼", "bad"),
}
"""Words that say whether something holds or is better, each with its mark and its kind of colour."""


def marked(words: str) -> str:
    """Return words that say whether something holds, with a mark and a colour; other words as they are."""
    known = VERDICTS.get(words)
    if known is None:
        return inline(words)
    mark, kind = known
    return f'<span class="{kind}">{mark} {escape(words)}</span>'


def wide(label: str, body: str, *, captioned: bool = True) -> str:
    """Return a block that scrolls sideways if it is too wide, also by keyboard; `label` names it.

    It stands above the block if it is `captioned`.
    """
    caption = f'<p class="label">{escape(label)}</p>' if captioned else ""
    name = f"{escape(label)}, scrollable"
    return f'{caption}<div class="wide" tabindex="0" role="region" aria-label="{name}">{body}</div>'


def code(text: str, label: str = "text") -> str:
    """Return preformatted text in a scrollable box; `label` is its name for screen readers."""
    return f'<pre tabindex="0" role="region" aria-label="{escape(label)}">{escape(text)}</pre>'


def facts(pairs: Sequence[tuple[str, str]]) -> str:
    """Return a description list from pairs of a term and its description."""
    return f"<dl>{''.join(f'<dt>{escape(k)}</dt><dd>{inline(v)}</dd>' for k, v in pairs)}</dl>"


@cache
def _resource(name: str) -> str:
    """Return the style or the script of every page."""
    return files("graspsense.report").joinpath(name).read_text(encoding="utf-8")
