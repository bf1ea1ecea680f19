"""A page: one HTML file that loads nothing, needs no script, prints, and reads well aloud and on a telephone."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
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
    """A page. `answer` is the sentence that a reader came for; `beside` is what must be read with it, as HTML."""

    kind: str
    title: str
    question: str
    answer: str
    beside: str = ""
    sections: tuple[Section, ...] = field(factory=tuple)

    def html(self) -> str:
        """Return the whole file."""
        links = "".join(f'<li><a href="#{one.id}">{escape(one.title)}</a></li>' for one in self.sections)
        sections = "".join(
            f'<section id="{one.id}" aria-labelledby="{one.id}-h"><h2 id="{one.id}-h">{escape(one.title)}</h2>'
            f"{one.body}</section>"
            for one in self.sections
        )
        question = f'<p class="question">{escape(self.question)}</p>' if self.question else ""
        return (
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            # Nothing may be loaded or run, whatever is in the names of trials.
            '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
            "style-src 'unsafe-inline'; img-src data:\">\n"
            f'<meta name="generator" content="graspsense {__version__}">\n'
            f"<title>{escape(self.title)} – graspsense</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
            f'<header><p class="kind">{escape(self.kind)}</p><h1>{escape(self.title)}</h1>{question}</header>\n'
            f'<main>\n<section id="answer" class="answer" aria-labelledby="answer-h"><h2 id="answer-h">Answer</h2>'
            f'<p class="sentence">{escape(self.answer)}</p>{self.beside}</section>\n'
            f'<nav aria-label="On this page"><ul>{links}</ul></nav>\n{sections}\n</main>\n'
            f"<footer><p>Made by graspsense {__version__}. This page loads nothing from elsewhere.</p></footer>\n"
            "</body>\n</html>\n"
        )


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text."""
    return f"<p{_class(kind)}>{escape(text)}</p>"


def bullets(items: Sequence[str], kind: str = "") -> str:
    """Return a list of plain texts, nothing for none."""
    return f"<ul{_class(kind)}>{''.join(f'<li>{escape(one)}</li>' for one in items)}</ul>" if items else ""


def figure(picture: str, caption: str) -> str:
    """Return a picture with a caption of plain text."""
    return f"<figure>{picture}<figcaption>{escape(caption)}</figcaption></figure>"


def panels(figures: Sequence[str]) -> str:
    """Return figures side by side where there is room."""
    return f'<div class="panels">{"".join(figures)}</div>'


def pair(left: str, right: str) -> str:
    """Return two things beside each other where there is room."""
    return f'<div class="pair"><div>{left}</div><div>{right}</div></div>'


def folded(summary: str, body: str) -> str:
    """Return something that is shown when it is asked for, and in print."""
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], numbers: int = 99) -> str:
    """Return a table of plain texts, the first cell of a row its heading; columns from `numbers` on are numbers.

    It scrolls by itself where it is too wide.
    """
    kinds = [' class="n"' if k >= numbers else "" for k in range(len(header))]
    head = "".join(
        f'<th scope="col"{kind}>{escape(one)}</th>' for one, kind in zip(header, kinds, strict=True)
    )
    body = "".join(
        "<tr>"
        + f'<th scope="row">{escape(row[0])}</th>'
        + "".join(f"<td{kind}>{escape(one)}</td>" for one, kind in zip(row[1:], kinds[1:], strict=True))
        + "</tr>"
        for row in rows
    )
    return wide(
        caption,
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>",
    )


def wide(label: str, body: str) -> str:
    """Return something that scrolls by itself where it is too wide, also by keyboard; `label` stands above it."""
    return (
        f'<p class="label">{escape(label)}</p>'
        f'<div class="wide" tabindex="0" role="region" aria-label="{escape(label)}">{body}</div>'
    )


def facts(pairs: Sequence[tuple[str, str]]) -> str:
    """Return names with what they stand for."""
    return f"<dl>{''.join(f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in pairs)}</dl>"


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


STYLE: Final = """
:root{color-scheme:light}
*{box-sizing:border-box}
body{margin:0;background:#fff;color:#1a1a1a;font:1rem/1.55 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif}
header,main,footer{max-width:72rem;margin:0 auto;padding:0 1rem}
header{padding-top:1.5rem}
.kind{margin:0;color:#5c5c5c;font-size:.9rem}
h1{margin:.1rem 0;font-size:1.9rem;line-height:1.2}
h2{margin:2.2rem 0 .5rem;font-size:1.3rem;border-top:1px solid #c8c8c8;padding-top:.8rem}
h3{margin:1.4rem 0 .3rem;font-size:1.05rem}
p,ul,dl{max-width:46rem}
.question{margin:.2rem 0 1rem;font-size:1.15rem;color:#3d3d3d}
.answer{background:#eef4fa;border-left:.35rem solid #0b5fa5;padding:.6rem 1rem 1rem;margin:1rem 0}
.answer h2{margin:0;border:0;padding:0;font-size:.95rem;color:#084a80}
.sentence{margin:.2rem 0 .8rem;font-size:1.3rem;line-height:1.4}
.warning li{margin:.3rem 0}
.warning{list-style:none;padding:.5rem .8rem;border:2px solid #9a3200;background:#fff6ef}
.warning li::before{content:"Warning: ";font-weight:600}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;list-style:none;padding:0;margin:.8rem 0}
a{color:#084a80}
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));gap:.5rem 2rem}
.pair>div{min-width:0}
.panels>*{min-width:0}
.panels{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,20.5rem),1fr));gap:1rem 1.5rem}
figure{margin:.6rem 0;max-width:34rem;break-inside:avoid}
figure svg{display:block;width:100%;height:auto;font-family:inherit}
figcaption{font-size:.9rem;color:#3d3d3d}
.wide{overflow-x:auto;margin:.6rem 0;max-width:100%}
table{border-collapse:collapse;font-size:.92rem;break-inside:avoid}
.label{font-size:.9rem;color:#3d3d3d;margin:.8rem 0 0}
th,td{padding:.25rem .6rem;text-align:left;border-bottom:1px solid #dcdcdc;font-weight:400;vertical-align:top}
thead th{font-weight:600;border-bottom:2px solid #8a8a8a}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
thead .n{white-space:normal}
.matrix td{text-align:center;min-width:2.3rem;border:1px solid #fff;font-variant-numeric:tabular-nums}
.matrix thead th{vertical-align:bottom;text-align:center;padding:.3rem .1rem}
.matrix thead th span{writing-mode:vertical-rl;transform:rotate(180deg);white-space:nowrap}
.matrix tbody th{white-space:nowrap;border:0}
.matrix .right{outline:2px solid #1a1a1a;outline-offset:-3px}
.tree,.tree ul{list-style:none;margin:0;padding:0}
.tree{max-width:none;font-size:.95rem}
.tree ul{margin-left:.55rem;padding-left:.9rem;border-left:2px solid #8a8a8a}
.tree li{margin:.15rem 0}
.tree .leaf{font-weight:600}
.tree .count{color:#5c5c5c;font-size:.85rem}
dl{display:grid;grid-template-columns:minmax(7rem,max-content) 1fr;gap:.2rem 1rem;margin:.5rem 0}
dt{color:#5c5c5c}
dd{margin:0;overflow-wrap:anywhere}
pre{overflow-x:auto;background:#f5f5f5;padding:.7rem;font-size:.85rem}
summary{cursor:pointer;color:#084a80;padding:.3rem 0}
:focus-visible{outline:3px solid #0b5fa5;outline-offset:2px}
footer{margin-top:2.5rem;padding-bottom:1.5rem;color:#5c5c5c;font-size:.9rem}
@media (max-width:34rem){dl{grid-template-columns:1fr}dd{margin-bottom:.4rem}h1{font-size:1.55rem}
.sentence{font-size:1.15rem}}
@media print{nav,.panels details{display:none}summary{list-style:none;color:inherit;font-weight:600}
body{font-size:10pt}.wide{overflow:visible}a{color:inherit}
.answer{background:none}details::details-content{content-visibility:visible;display:block}
*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
"""
