"""What a one-sided contact does, in words."""

import enum
from collections.abc import Mapping

import numpy as np
from jaxtyping import Array, Bool

from .._tools._errors import RedundaxError
from .._tools._numbers import Numeric, take, xp
from ._names import Named, Names


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


UNKNOWN = -1  # in arrays, where there is no answer
LEFT_OUT = tuple(map(code_of, (Contact.open, Contact.lifts)))  # codes of what carries in no solution


def rows_that_hold(names: Names, loaded: Numeric, closed: Numeric) -> Bool[Array, " m"]:
    """All rows but those of contacts that do not hold, (contacts,) each: the one-sided row holds where it is loaded,
    and rows of velocity that are tied to it where it is closed."""
    count = len(names.one_sided)
    places = np.full(len(names.rows), -1)
    places[list(names.one_sided)] = np.arange(count)
    for contact, rows in enumerate(names.tied):
        places[list(rows)] = count + contact
    return take(xp.concatenate([xp.asarray(loaded), xp.asarray(closed), xp.ones(1, bool)]), places)


def refuse_declared(names: Names, **given: object) -> None:
    """Refuse arguments, by name, that declare what one-sided contacts decide, such as the rank."""
    if names.one_sided and any(value is not None for value in given.values()):
        several = len(given) > 1
        raise RedundaxError(
            f"Argument{'s' if several else ''} {' and '.join(f'`{name}`' for name in given)} must be left out where "
            f"contacts are one-sided, {', '.join(names.contacts)}: which of them are closed decides "
            f"{'both' if several else 'it'}."
        )


def is_closed(word: str) -> bool:
    """Whether a contact of which this is said is closed and stays so."""
    return word not in (Contact.open, Contact.lifts)


def rows_closed(names: Names, contacts: Mapping[str, str]) -> tuple[Bool[np.ndarray, " c"], Bool[Array, " m"]]:
    """Which contacts are closed and stay so, by what each does in words, and the rows that hold then."""
    closed = np.array([is_closed(contacts[name]) for name in names.contacts])
    return closed, rows_that_hold(names, closed, closed)


def words(codes: Numeric | None, names: Names | None) -> dict[str, str | np.ndarray]:
    """What contacts do, by name, and "" where it is not known; of a batch arrays of words. None do anything where there
    are none, or no names."""
    if codes is None or names is None:
        return Named()
    table = np.array([*map(str, _WORDS), ""])
    columns = np.moveaxis(np.asarray(codes), -1, 0)
    own = ((*_WORDS, "")[int(column)] if column.ndim == 0 else table[column] for column in columns)
    return Named(zip(names.contacts, own, strict=True))


def in_sentences(contacts: Mapping[str, str | np.ndarray]) -> list[str]:
    """A line on the contacts of one state, as in "Contacts f1, f4: lifts; f2, f3: carries"; of a batch none."""
    if not contacts or any(np.ndim(does) for does in contacts.values()):
        return []
    by_word = {word: [name for name, does in contacts.items() if does == word] for word in _WORDS}
    return ["Contacts " + "; ".join(f"{', '.join(names)}: {word}" for word, names in by_word.items() if names)]
