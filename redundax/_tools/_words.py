"""Words of messages: near names, values cut short, and text without signs that would act on a terminal."""

import difflib
import heapq
import inspect
import itertools
import operator
import reprlib
import traceback
import unicodedata
import warnings
from collections.abc import Iterable

_ACTING = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of Unicode: control, format (as of direction), halves, line ends
_SAME = 0.1  # what the same first word adds to how near a name is
_BETWEEN = ("redundax", "equinox", "jax", "jaxtyping", "contextlib", "functools")
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxdict, _SHORT.maxstring, _SHORT.maxother = 2, 4, 4, 60, 60


def short(value: object) -> str:
    """A value of any size as a message shows it."""
    return _SHORT.repr(value)


def warn(text: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line of the user, whatever calls stand between: of redundax, or of what calls it and is called."""
    frames = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_stack(inspect.currentframe()))
    ours = itertools.takewhile(lambda name: name.partition(".")[0] in _BETWEEN, frames)
    warnings.warn(text, category, stacklevel=1 + len(list(ours)))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A question about near names, those with the same first word, such as a joint, before others as near; a space
    behind it. Nothing where none is near."""
    known, word = list(known), name.split(" ")[0]
    ratios = [(difflib.SequenceMatcher(None, each, name).ratio(), each) for each in known]
    ranked = [(ratio + _SAME * (each.split(" ")[0] == word), each) for ratio, each in ratios if ratio >= 0.5]
    near = [each for _, each in heapq.nlargest(3, ranked, key=operator.itemgetter(0))]
    near = near or [each for each in known if each.startswith(f"{name} ")][:3]
    return f"Did you mean {' or '.join(map(repr, near))}? " if near else ""


def printable(text: str) -> str:
    """Text with signs that would act on a terminal, as of colour or direction, as their codes; line ends stay."""
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    return "".join(
        sign.encode("unicode_escape").decode()
        if sign != "\n" and sign != "\t" and unicodedata.category(sign) in _ACTING
        else sign
        for sign in text
    )


def ended(text: str) -> str:
    """Sentences with a full stop, if they end without a sign."""
    text = text.strip()
    return text if text.endswith((".", "?")) else f"{text}."
