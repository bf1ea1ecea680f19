"""The text of a label, so that labels which look the same are the same."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from typing import Final

from graspsense.core.values.errors import listed

MISSING_LABELS: Final = frozenset({"", "nan", "?", "<missing>", "<undefined>"})
"""What stands for a missing label, the last two in MATLAB. `none`, `null` and `NA` are labels."""
_WHOLE: Final = re.compile(r"(?<![^:#])([-+]?[0-9]+)[.,]0+(?![^:#])")
_SCIENTIFIC: Final = re.compile(r"[-+]?[0-9]\.[0-9]+[eE][-+]0[0-9]")

_JOINTS: Final = re.compile(
    r"(?<=[^\W\d])[\s_\-\u2010-\u2015:/.]+(?=\w)|(?<=\w)[\s_\-\u2010-\u2015:/.]+(?=[^\W\d])|(?<=\s)\s+"
)
"""Spaces, underscores, hyphens and signs between words, beside a letter."""
_LEADING: Final = re.compile(r"(?<![\d.])0+(?=\d)")
_FILLERS: Final = re.compile(
    "[\u034f\u0640\u115f\u1160\u17b4\u17b5\u180b-\u180f\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)
"""Letters and marks that nothing shows, and the Arabic stroke that only lengthens a word."""
_LOOK_ALIKE: Final = str.maketrans(
    "АВЕКМНОРСТУХІЈЅаеорсухіјѕһԁԛԝ" + "ΑΒΕΖΗΙΚΜΝΟΡΤΥΧαονρυικτχ" + "ıɡℓ,",
    "ABEKMHOPCTYXIJSaeopcyxijshdqw" + "ABEZHIKMNOPTYXaovpuiktx" + "igl.",
)
"""Cyrillic, Greek and other letters, the Latin ones that they look like, and the decimal comma."""
_ACCENTS: Final = re.compile("(?<=[a-z])[\u0300-\u036f]+")
_QUOTES: Final = " .'`\"\u00ab\u00bb\u2018\u2019\u201a\u201c\u201d\u201e\u2039\u203a"
_LAST_ZEROS: Final = re.compile(r"(?<!\d)(\d+\.\d*[1-9])0+(?![\d.])")
_NUMBER: Final = re.compile(r"\d+")


def natural_order(labels: Iterable[str]) -> list[str]:
    """Return the different labels as a reader looks for them, with the numbers in them by size.

    >>> natural_order(["can10", "can2", "can2", "box"])
    ['box', 'can2', 'can10']
    """
    return sorted(
        set(labels), key=lambda label: (_NUMBER.sub(lambda digits: digits[0].zfill(32), label), label)
    )


def label_text(text: str) -> str:
    r"""Return a label without invisible characters, in the composed form of Unicode, and whole numbers without `.0`.

    >>> label_text("cafe\u0301\u200b "), label_text("1.0"), label_text("can:1.0"), label_text("1.5")
    ('café', '1', 'can:1', '1.5')
    >>> label_text("2.000000e+00"), label_text("2.5e+00")  # as numpy and MATLAB write numbers
    ('2', '2.5e+00')
    """
    if not isinstance(text, str):
        raise TypeError(f"a label or an instance is text, not {text!r}")
    if not text.isascii():
        text = unicodedata.normalize("NFC", text)
        text = "".join(
            sign for sign in _FILLERS.sub("", text) if unicodedata.category(sign) not in ("Cf", "Cc")
        )
        text = "".join(" " if unicodedata.category(sign) == "Zs" else sign for sign in text)
    text = text.strip()
    if _SCIENTIFIC.fullmatch(text) and float(text).is_integer():
        return f"{float(text):.0f}"
    return _WHOLE.sub(r"\1", text)


def spelled_alike(texts: Iterable[str]) -> list[tuple[str, str]]:
    """Return pairs of different labels or names that differ in case, accents, spaces, hyphens, quotes, width or leading
    zeros only, in the last zeros or the comma of a decimal number, or in letters of two alphabets that look the same.
    So is a letter alike with the only word that it begins.

    >>> spelled_alike(["tin-can", "tin\u2010can"])
    [('tin-can', 'tin‐can')]
    >>> spelled_alike(["can1", "Can 01", "can2", "-2", "2", "1-2", "12", "0.5", "0,50", "1.20.30", "'full'", "full."])
    [('0,50', '0.5'), ('Can 01', 'can1'), ("'full'", 'full.')]
    >>> spelled_alike(["yes", "no", "Y"]), spelled_alike(["a", "ab", "can", "cup", "c"])
    ([('Y', 'yes')], [])
    """
    by_form: dict[str, str] = {}
    pairs = []
    for text in sorted(set(texts)):
        form = unicodedata.normalize("NFKD", text.translate(_LOOK_ALIKE)).translate(_LOOK_ALIKE).casefold()
        form = _ACCENTS.sub("", form)
        form = _LEADING.sub("", _JOINTS.sub("", form.strip(_QUOTES)))
        form = _LAST_ZEROS.sub(r"\1", form)
        other = by_form.setdefault(form, text)
        if other != text:
            pairs.append((other, text))
    for letter in filter(str.isalpha, by_form):
        words = [word for word in by_form if word[:1] == letter and len(word) > 2 and word.isalpha()]
        pairs += [(by_form[letter], by_form[word]) for word in words if len(letter) == len(words)]
    return pairs


def alike_words(pairs: Iterable[tuple[str, str]]) -> str:
    r"""Return pairs of `spelled_alike` in words, with the code of a letter that another alphabet has.

    >>> print(alike_words([("can", "c\u0430n"), ("Can 1", "can1")]))
    'can' and 'c\u0430n', 'Can 1' and 'can1'
    """
    shown = [map(ascii if x.isascii() != y.isascii() else repr, (x, y)) for x, y in pairs]
    return listed([" and ".join(pair) for pair in shown])


def is_missing_label(text: str) -> bool:
    """Return whether the text of a cell stands for a missing label."""
    return label_text(text).lower() in MISSING_LABELS
