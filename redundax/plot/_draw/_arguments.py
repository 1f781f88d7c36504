"""Arguments of drawings, checked, and the loads they ask for."""

from collections.abc import Sequence

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._analyze import analyze
from ..._bodies._mechanism import Mechanism
from ..._solve._solution import Solution
from ..._system._contact import Contact
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import is_concrete
from ._arrows import LOADS, SMOOTH, STRESSES, Arrows, joint_arrows
from ._scene import Scene

Given = ArrayLike | Sequence[float]


def load_groups(
    scene: Scene, mechanism: Mechanism, state: State, self_stress: int | Given | None, multipliers: Given | None
) -> list[Arrows]:
    """Arrows of a self-stress state and of joint loads, of what was given."""
    groups = []
    if self_stress is not None:
        lam = _stress(mechanism, state, self_stress)
        groups.append(Arrows(STRESSES, joint_arrows(scene, mechanism, state, lam), scene.camera.view))
    if multipliers is not None:
        lam = _vector("multipliers", multipliers, mechanism)
        groups.append(loads_of(scene, mechanism, state, lam))
    return groups


def loads_of(scene: Scene, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> Arrows:
    """Arrows of joint loads."""
    look = LOADS if mechanism.friction else SMOOTH
    return Arrows(look, joint_arrows(scene, mechanism, state, multipliers), scene.camera.view)


def idle_contacts(mechanism: Mechanism, state: State, solution: Solution) -> dict[str, str]:
    """What one-sided contacts do that do not carry, by name, and the gap of those that are open."""
    names, rows = mechanism.names, np.array(mechanism.names.one_sided, int)
    gaps, out = -np.asarray(mechanism.constraint(state.q, state.t)), {}
    for row, (name, word) in zip(rows, solution.contacts.items(), strict=True):
        gap = f" by {gaps[row]:.3g} {names.units.of('linear')}".rstrip() if word == Contact.open else ""
        if word != Contact.carries:
            out[name] = f" {word}{gap}"
    return out


def check(mechanism: object, scale: float | None) -> None:
    """Refuse what cannot be drawn."""
    if not isinstance(mechanism, Mechanism):
        raise RedundaxError(
            f"Argument `mechanism` must be a `Mechanism`, but is a {type(mechanism).__name__}, "
            "which has no bodies and joints to draw. Build it with `rx.Mechanism`."
        )
    if not mechanism.names.bodies:
        raise RedundaxError(
            "Argument `mechanism` must have its names, but is anonymous. Draw the one it was made from."
        )
    if scale is not None and not scale > 0:
        raise RedundaxError(
            f"Argument `scale` must be positive, the length on the drawing of a force of 1, but is {scale}. "
            "Leave it out for one that fits."
        )


def positions(mechanism: Mechanism) -> int:
    """Entries of q."""
    return len(mechanism.coordinates) if mechanism.adds else mechanism.reference.size


def check_state(mechanism: Mechanism, state: State) -> None:
    """Refuse a state that is not one of this mechanism."""
    n = positions(mechanism)
    if state.q.shape != (n,):
        raise RedundaxError(
            f"Argument `state` must have q of shape ({n},), but has {state.q.shape}. Give one state, of this mechanism."
        )
    if not is_concrete(state.q):
        raise RedundaxError(
            "Argument `state` must hold known numbers, but they are traced by `jit`, `vmap` or `grad`. Draw outside of "
            "these."
        )
    if not np.all(np.isfinite(state.q)):
        raise RedundaxError(
            "Argument `state` must have finite coordinates, but its q holds NaN or infinity. "
            "Look at the `result` of what made it."
        )


def _vector(argument: str, values: Given, mechanism: Mechanism) -> np.ndarray:
    vector, m = np.asarray(values, float), len(mechanism.rows)
    if vector.shape != (m,):
        has = f"has {vector.shape[0]}" if vector.ndim == 1 else f"has shape {vector.shape}"
        raise RedundaxError(
            f"Argument `{argument}` must have one entry for each of the {m} rows, but {has}. "
            "Give 0 where there is no load."
        )
    if not np.all(np.isfinite(vector)):
        row = mechanism.rows.labels[int(np.argmin(np.isfinite(vector)))]
        raise RedundaxError(
            f"Argument `{argument}` must be finite, but its entry '{row}' is {vector[~np.isfinite(vector)][0]}. "
            "A solution's multipliers are NaN where its `result` is not successful."
        )
    return vector


def _stress(mechanism: Mechanism, state: State, given: int | Given) -> np.ndarray:
    if np.ndim(given) > 0:
        return _vector("self_stress", given, mechanism)
    states, index = analyze(mechanism, state).self_stress, float(np.asarray(given))
    if index != int(index) or not -len(states) <= index < len(states):
        raise RedundaxError(
            f"Argument `self_stress` must be an index below {len(states)}, the number of self-stress states here, "
            f"or a vector, but is {given}. Count from 0."
        )
    return states[int(index)]
