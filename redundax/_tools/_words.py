"""Words of messages: near names, values cut short, and text without signs that would act on a terminal."""

import difflib
import reprlib
import unicodedata
from collections.abc import Iterable

_ACTING = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of Unicode: control, format (as of direction), halves, line ends
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxdict, _SHORT.maxstring, _SHORT.maxother = 2, 4, 4, 60, 60


def short(value: object) -> str:
    """A value of any size as a message shows it."""
    return _SHORT.repr(value)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A question about near names, first of those with the same first word, such as a joint; a space behind it.

    Nothing where none is near.
    """
    known = list(known)
    same = [each for each in known if each.split(" ")[0] == name.split(" ")[0]]
    near = difflib.get_close_matches(name, same, 3, 0.5) or same[:3] or difflib.get_close_matches(name, known, 3, 0.5)
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
