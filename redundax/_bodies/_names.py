"""Names of bodies and joints: what they connect must exist."""

from collections.abc import Sequence

from ._body import GROUND
from ._joints import AbstractJoint
from ._loads import AbstractLoad


def check_names(bodies: Sequence[str], joints: Sequence[AbstractJoint], loads: Sequence[AbstractLoad]) -> None:
    """Refuse names that occur twice, bodies that nobody declared, and joints of a body with itself."""
    for what, names in (("bodies", list(bodies)), ("joints", [joint.name for joint in joints])):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(
                f"Argument `{what}` must have different names, but {twice} occur more than once. Rename them."
            )
        if not names:
            raise ValueError(f"Argument `{what}` must hold at least one element, but is empty. Add one.")
    if GROUND in bodies:
        raise ValueError(f"Argument `bodies` must not hold a body named '{GROUND}': that is the fixed base.")
    known = {*bodies, GROUND}
    for what, elements in (("joints", joints), ("loads", loads)):
        for element in elements:
            label = getattr(element, "name", type(element).__name__)
            for body in (element.i, element.j):
                if body not in known:
                    raise ValueError(
                        f"Argument `{what}`: '{label}' connects '{body}', which is no body of the mechanism. "
                        f"The bodies are {sorted(known)}."
                    )
            if element.i == element.j:
                raise ValueError(
                    f"Argument `{what}`: '{label}' must connect two different bodies, but connects "
                    f"'{element.i}' with itself. Correct `i` or `j`."
                )
    used = {body for joint in joints for body in (joint.i, joint.j)}
    loose = [body for body in bodies if body not in used]
    if loose:
        raise ValueError(f"Argument `bodies`: {loose} have no joint. Connect them, or leave them out of the mechanism.")
