"""Parts of a mechanism: each in its list, and between bodies that exist."""

from collections.abc import Mapping, Sequence
from types import UnionType

from .._tools._errors import RedundaxError
from ._body import GROUND, AbstractBody
from ._coupler import Coupler, Stop
from ._frame import AbstractFrame
from ._joints import AbstractJoint
from ._loads import AbstractLoad
from ._speed_driver import SpeedDriver

_LISTS: tuple[tuple[str, type | UnionType, str], ...] = (
    ("bodies", AbstractBody, "Body"),
    ("joints", AbstractJoint, AbstractJoint.__name__),
    ("loads", AbstractLoad, AbstractLoad.__name__),
    ("couplers", Coupler | Stop | SpeedDriver, "Coupler"),
)


def check_kinds(bodies: object, joints: object, loads: object, couplers: object) -> None:
    """Refuse what stands in the wrong list, or in none."""
    for (what, kind, fitting), elements in zip(_LISTS, (bodies, joints, loads, couplers), strict=True):
        if not isinstance(elements, Sequence):
            way = "Give a list of its values." if isinstance(elements, Mapping) else "Put it in brackets: [...]."
            raise RedundaxError(f"Argument `{what}` must be a list, but is {_words(elements)}. {way}")
        for element in elements:
            if not isinstance(element, kind):
                right = [f"Put it among `{other}`." for other, fit, _ in _LISTS if isinstance(element, fit)]
                raise RedundaxError(
                    f"Argument `{what}` must hold {what}, but holds {_words(element)}. "
                    f"{' '.join(right) or f'Leave it out, or make it an `rx.{fitting}`.'}"
                )


def check_frames(frame: AbstractFrame, what: str, *elements: AbstractBody | AbstractJoint | AbstractLoad) -> None:
    """Refuse planar parts of a spatial mechanism, and spatial parts of a planar."""
    for element in elements:
        if type(element.frame) is not type(frame):
            here = "rx.spatial" if frame.word == "spatial" else "rx"
            raise RedundaxError(
                f"Argument `{what}`: a mechanism must be all planar or all spatial, but {_words(element)} is "
                f"{element.frame.word} and its first body {frame.word}. Take all parts from `{here}`."
            )


def _words(element: object) -> str:
    """Class of an element, and its name or the body that it acts on."""
    if isinstance(element, type):
        return f"the class {element.__name__}"
    name = getattr(element, "name", getattr(element, "i", None))
    return f"{type(element).__name__} {name!r}" if isinstance(name, str) else f"{type(element).__name__} {element!r}"


def check_names(
    bodies: Sequence[str],
    joints: Sequence[AbstractJoint],
    loads: Sequence[AbstractLoad],
    couplers: Sequence[Coupler | Stop | SpeedDriver] = (),
) -> None:
    """Refuse names that occur twice, bodies that nobody declared, and joints of a body with itself."""
    for what, names in (("bodies", list(bodies)), ("joints", [each.name for each in (*joints, *couplers)])):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise RedundaxError(
                f"Argument `{what}` must have different names, but {twice} occur more than once. Rename them."
            )
        if not all(name.strip() for name in names):
            raise RedundaxError(f"Argument `{what}` must have names, but one is called {min(names)!r}. Give it a word.")
        if not names:
            raise RedundaxError(f"Argument `{what}` must hold at least one element, but is empty. Add one.")
    if GROUND in bodies:
        raise RedundaxError(f"Argument `bodies` must not hold a body named '{GROUND}': that is the fixed base.")
    check_ends(bodies, joints=joints, loads=loads)
    used = {body for joint in joints for body in (joint.i, joint.j)}
    loose = [body for body in bodies if body not in used]
    if loose:
        raise RedundaxError(
            f"Argument `bodies`: {loose} have no joint. Connect them, or leave them out of the mechanism."
        )


def check_ends(bodies: Sequence[str], **elements: Sequence[AbstractJoint | AbstractLoad]) -> None:
    """Refuse joints and loads of bodies that nobody declared, and of one with itself."""
    known = {*bodies, GROUND}
    for what, group in elements.items():
        for element in group:
            label = getattr(element, "name", type(element).__name__)
            for body in (element.i, element.j):
                if body not in known:
                    raise RedundaxError(
                        f"Argument `{what}`: '{label}' connects '{body}', which is no body of the mechanism. "
                        f"The bodies are {sorted(known)}."
                    )
            if element.i == element.j:
                raise RedundaxError(
                    f"Argument `{what}`: '{label}' must connect two different bodies, but connects "
                    f"'{element.i}' with itself. Correct `i` or `j`."
                )
