"""One mechanism described twice, as designed and as it is: whether it is the same, and its rows in the axes as designed

Rows of a joint are along the axes A of its placement on body j. Most joints constrain the same with A Q for A on both
bodies, where Q is any turn about z, or of some any turn at all. So the Q is taken that brings A of the joint as it is
nearest to the nominal axes:

    T = A^T A_nominal,   Q = T  or  about z by  arctan((T_yx - T_xy) / (T_xx + T_yy))

Couplers read coordinates of joints, which count from the marks as they are given.
"""

from collections.abc import Sequence
from itertools import zip_longest
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._bodies._body import GROUND
from .._bodies._joint_rows import Positions, residuals
from .._bodies._mechanism import Mechanism
from .._bodies._space._rotation import about_z, multiplied
from .._bodies._stack import Stack
from .._system._axis import Axis
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._module import is_concrete, replace_fields, tree_take


def check_comparable(nominal: AbstractSystem, actual: AbstractSystem) -> None:
    """Refuse what is not the same system with other lengths and angles, by names where both have some."""
    if isinstance(nominal, Mechanism) and isinstance(actual, Mechanism):
        _check_parts(nominal, actual)
    named = nominal.rows.names is not None and actual.rows.names is not None
    _check_same(*(_rows(each.rows, named) for each in (nominal, actual)))


def _check_parts(nominal: Mechanism, actual: Mechanism) -> None:
    pair = nominal, actual
    if not all(each.names.joints for each in pair):
        return
    known = all(map(is_concrete, [index for each in pair for stack in each.joints for index in (stack.i, stack.j)]))
    _check_same(*([f"body '{name}'" for name in each.names.bodies] for each in pair))
    _check_same(*(_joints(each, known) for each in pair))
    _check_senses(nominal, actual)


def _check_same(nominal: Sequence[str], actual: Sequence[str]) -> None:
    for one, other in zip_longest(nominal, actual, fillvalue="nothing more"):
        if one != other:
            raise RedundaxError(
                f"Argument `actual` must be `system` with other lengths and angles, but has {other} where `system` has "
                f"{one}. Give the same bodies, joints and couplers, by the same names and in the same order."
            )


def _joints(mechanism: Mechanism, known: bool) -> list[str]:
    """Kind, name and, where they are known, bodies of all joints, in the order in which they were given."""
    bodies, words = (*mechanism.names.bodies, GROUND), {}
    for stack, names in zip(mechanism.joints, mechanism.names.joints, strict=True):
        ends = np.stack([stack.i, stack.j], axis=1).tolist() if known else [()] * len(names)
        for name, pair in zip(names, ends, strict=True):
            between = " and ".join(f"'{bodies[end]}'" for end in pair)
            words[name] = f"{type(stack.element).__name__} '{name}'" + (f" between {between}" if known else "")
    return [words[name] for name, *_ in mechanism.names.joined]


def _rows(rows: Axis, named: bool) -> list[str]:
    labels = rows.labels if named else map(str, range(len(rows)))
    return [f"{kind}-type row '{label}'" for label, kind in zip(labels, rows.kinds, strict=True)]


def _check_senses(nominal: Mechanism, actual: Mechanism) -> None:
    """Refuse axes and normals that point the other way, which would turn the sign of rows."""
    there = _directions(actual)
    for key, direction in _directions(nominal).items():
        if key in there and direction @ there[key] <= 0:
            raise RedundaxError(
                "Argument `actual` must have joints whose axes and normals point as those of `system`, but joint "
                f"'{key[0]}' has one on body {key[1]} that is a right angle or more from that of `system`. If it is "
                "the same line, turn it round on both bodies."
            )


def _directions(mechanism: Mechanism) -> dict[tuple[str, str], np.ndarray]:
    """Axes and normals of joints that read them, by name and body, as far as they are known."""
    found = {}
    for stack, names in zip(mechanism.joints, mechanism.names.joints, strict=True):
        for end, directions in stack.element.directions().items():
            if is_concrete(directions):
                found |= {(name, end): each for name, each in zip(names, np.asarray(directions), strict=True)}
    return found


def residual_by_axes_of(nominal: Mechanism, actual: Mechanism, q: Array, t: Array) -> Float[Array, " m"]:
    """Residual of the actual mechanism, its rows in the axes of the nominal one."""
    if all(_free_axes(stack) == "none" for stack in actual.joints):
        return actual.constraint(q, t)
    joints = tuple(
        replace_fields(stack, element=replace_fields(stack.element, **axes))
        for stack, axes in zip(actual.joints, _turned(nominal.anonymous, actual.anonymous), strict=True)
    )
    at = Positions(actual.poses(q), (None,) * len(joints))
    coupled = [each.residuals(actual.joints, at.poses) for each in actual.couplings]
    return actual.of_rows([*residuals(joints, at, t), *coupled])


def _free_axes(stack: Stack) -> str:
    return stack.element.free_axes if stack.element.row_kinds else "none"


@eqx.filter_jit
def _turned(nominal: Mechanism, actual: Mechanism) -> list[dict[str, Array]]:
    """Both axes of the joints of each stack that has free ones, nearest to the nominal ones.

    Joints find these by their rows: stacks of the two may differ, by sizes that friction alone reads, say.
    """
    own = []
    for stack, rows in zip(nominal.joints, nominal.rows_of_joints, strict=True):
        axes = stack.element.axes_on("j")
        axes = jnp.zeros((len(rows), 3, 3)) if axes is None else axes
        own.append(jnp.broadcast_to(axes[:, None], (*rows.shape, 3, 3)))
    by_row, found = nominal.of_rows(own), []
    for stack, rows in zip(actual.joints, actual.rows_of_joints, strict=True):
        which, turned = _free_axes(stack), {}
        if which != "none":
            both = {name: cast(Array, stack.element.axes_on(name[-1])) for name in ("axes_i", "axes_j")}
            turn = multiplied(jnp.swapaxes(both["axes_j"], -1, -2), tree_take(by_row, jnp.asarray(rows[:, 0])))
            turned = {name: multiplied(axes, turn if which == "all" else about_z(turn)) for name, axes in both.items()}
        found.append(turned)
    return found
