"""What a one-sided contact does, in words."""

import enum
from typing import Any

import numpy as np
from jaxtyping import Array, Bool

from .._tools._numbers import take, xp
from ._names import Names


class Contact(enum.StrEnum):
    """What a one-sided contact does."""

    open = "open"  # there is a gap
    lifts = "lifts"  # it opens
    touches = "touches"  # closed without load
    carries = "carries"

    __repr__ = str.__repr__


_WORDS = tuple(Contact)


def code_of(word: Contact) -> int:
    """Its number in arrays."""
    return _WORDS.index(word)


LEFT_OUT = tuple(map(code_of, (Contact.open, Contact.lifts)))  # codes of what carries in no solution


def rows_that_hold(names: Names, loaded: Any, closed: Any) -> Bool[Array, " m"]:
    """All rows but those of contacts that do not hold, (contacts,) each: the one-sided row holds where it is loaded,
    and rows of velocity that are tied to it where it is closed."""
    count = len(names.one_sided)
    places = np.full(len(names.rows), -1)
    places[list(names.one_sided)] = np.arange(count)
    for contact, rows in enumerate(names.tied):
        places[list(rows)] = count + contact
    return take(xp.concatenate([xp.asarray(loaded), xp.asarray(closed), xp.ones(1, bool)]), places)


def words(codes: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """What contacts do, by name; of a batch arrays of words."""
    table = np.array([str(word) for word in _WORDS])
    columns = np.moveaxis(np.asarray(codes), -1, 0)
    return {
        name: _WORDS[int(column)] if column.ndim == 0 else table[column]
        for name, column in zip(names, columns, strict=True)
    }


def in_sentences(contacts: dict[str, Any]) -> list[str]:
    """A line on the contacts of one state, as in "Contacts f1, f4: lifts; f2, f3: carries"; of a batch none."""
    if not contacts or any(np.ndim(does) for does in contacts.values()):
        return []
    by_word = {word: [name for name, does in contacts.items() if does == word] for word in _WORDS}
    return ["Contacts " + "; ".join(f"{', '.join(names)}: {word}" for word, names in by_word.items() if names)]
