"""Which loads of a log are determined, and how far it is from them

At each time, with the scaled Jacobian K = U S V^T, self-stress N (left null space), motion Z (null space) and figures
y = B lam of the log,

    a = K^+ g + Z (Z^T M Z)^-1 Z^T (Q - M K^+ g),   lam_0 = K^+T (Q - M a),   y = y_0 + B N z.

A figure with B N = 0 is determined. The others may differ from y_0 by what some z gives to all of them at once: the
nearest such is the self-stress that the log carries, and what it leaves is wrong, whatever the stiffness of joints.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._bodies._body import GROUND
from .._bodies._mechanism import Mechanism
from .._closures._closure import AbstractClosure, elasticity
from .._equations._kinematics import slip_force
from .._solve._solve import solve
from .._system._friction import load_rows
from .._system._state import State
from .._tools._computing import computing
from .._tools._errors import RedundaxError
from .._tools._numbers import as_arrays
from ._log import Figure
from ._motion import Models, Path, Reactions
from ._pushing import Held, pushed

AXES = ("global", "body", "joint")
_RANK = 1e-6  # singular values below, relative to the largest: numbers of files have no more digits
_LOOSE = 1e-5  # of the largest coefficient of its kind: a self-stress that is rounding in a figure, at such digits
_DIGITS = 1e-6  # of the largest load: of fewer digits no log is written
_ROUNDING = 1e-9  # of a load of the log, where self-stress is far larger than what the machine determines
_MASSLESS = 1e-12  # relative: inertia that is rounding


class Loads(NamedTuple):
    """Over time: multipliers of least norm, self-stress N, (m, k), and which times have the usual rank; and how many
    rows are more than that."""

    times: np.ndarray
    multipliers: np.ndarray
    stress: list[np.ndarray]
    judged: np.ndarray
    rank: int


class Kinds(NamedTuple):
    """What figures are: which are moments; which belong to one joint and kind, by number; a length of the machine, m,
    and its weight on earth, N."""

    turns: np.ndarray
    groups: np.ndarray
    length: float
    weight: float


class Judgement(NamedTuple):
    """Over time and figures, (times, figures): figures of least norm, what self-stress adds of the log, what is left of
    it, which are determined, and what counts as right, N or N m."""

    least: np.ndarray
    stress: np.ndarray
    wrong: np.ndarray
    determined: np.ndarray
    tolerance: np.ndarray


def loads_along(held: Held, path: Path, model: Models) -> Loads:
    """The loads that carry a motion."""
    system, open_rows = held.system, list(held.open_rows)
    scale, count, places = path.scale, len(system.rows), path.drive.places
    own = model.slopes[:, places] * scale.coordinates
    sizes = np.linalg.norm(own, axis=2).max(axis=0, initial=1e-300)
    rows = np.concatenate([model.jacobian * scale.coordinates / scale.rows[:, None], own / sizes[:, None]], axis=1)
    gamma = np.concatenate(
        [model.gamma / scale.rows, (path.drive.accelerations - model.bend[:, places]) / sizes], axis=1
    )
    mass = model.mass * scale.coordinates * scale.coordinates[:, None]
    load = (model.load + _friction(system, path)) * scale.coordinates
    found, stress, ranks = [], [], []
    per_row = np.concatenate([scale.rows, sizes])
    for K, g, M, f in zip(rows, gamma, mass, load, strict=True):
        if not all(np.all(np.isfinite(x)) for x in (K, g, M, f)):  # as where a law of time has no rate
            found.append(np.full(len(K), np.nan))
            stress.append(np.zeros((len(K), 0)))
            ranks.append(-1)
            continue
        U, values, axes = np.linalg.svd(K)
        rank = int(np.sum(values > _RANK * values.max(initial=0.0)))
        U1, V1, Z = U[:, :rank], axes[:rank].T, axes[rank:].T
        a = V1 @ (U1.T @ g / values[:rank])
        if Z.shape[1]:
            inertia, vectors = np.linalg.eigh(Z.T @ M @ Z)
            heavy = inertia > _MASSLESS * inertia.max(initial=0.0)
            a = a + Z @ (vectors[:, heavy] @ (vectors[:, heavy].T @ (Z.T @ (f - M @ a)) / inertia[heavy]))
        found.append(U1 @ (V1.T @ (f - M @ a) / values[:rank]) / per_row)
        stress.append(_without(U[:, rank:], open_rows) / per_row[:, None])
        ranks.append(rank)
    usual = max(set(ranks), key=lambda rank: (rank >= 0, ranks.count(rank)))
    finite = np.all(np.isfinite(np.stack(found)), axis=1)
    redundancy = count + len(places) - usual - len(open_rows)
    return Loads(path.times, np.stack(found), stress, (np.array(ranks) == usual) & finite, redundancy)


def _without(stress: np.ndarray, rows: list[int]) -> np.ndarray:
    """Self-stress without that of each of some rows by itself, which are zeros."""
    if not rows:
        return stress
    left = np.where(np.isin(np.arange(len(stress)), rows)[:, None], 0.0, stress)
    return np.linalg.svd(left)[0][:, : stress.shape[1] - len(rows)]


def _friction(system: Mechanism, path: Path) -> np.ndarray | float:
    """Forces of friction that no load of a joint changes; other friction is not judged."""
    if not system.friction:
        return 0.0
    if load_rows(system.friction).size:
        raise RedundaxError(
            "Argument `mechanism` must be without friction that depends on loads, which no log tells. Judge it by "
            "`rx.analyze` at single states, or take friction out to judge the loads that it leaves alone."
        )
    found = []
    for t, q, qd in zip(path.times, path.q, path.qd, strict=True):
        state = as_arrays(State(q, qd, t))
        solution = solve(system, state, throw=False)
        found.append(np.asarray(slip_force(system, state, solution.friction)))
    return np.stack(found)


def coefficients_of(
    system: Mechanism, columns: int, on: tuple[Reactions, Reactions], figures: Sequence[Figure], axes: str
) -> np.ndarray:
    """B of figures of joints, (times, figures, columns), along `axes`; `on` are reactions on the bodies that columns
    without a body and with "told" mean, and on the others."""
    d, out = len(system.frame.linear), np.zeros((len(on[0].axes), len(figures), columns))
    where = [(k, place) for k, names in enumerate(system.names.joints) for place in range(len(names))]
    rows = [row for stack in system.rows_of_joints for row in np.asarray(stack)]
    bodies = (*system.names.bodies, GROUND)
    for column, figure in enumerate(figures):
        (stack, place), own = where[figure.joint], on[bool(figure.is_other)]
        both = own.by_rows[stack][:, place]  # (times, parts, rows)
        force, part = both[:, :d], both[:, :d] if figure.part == "force" else both[:, d:]
        if figure.point is not None and figure.part == "moment":
            part = part + np.cross((own.points[stack][:, place] - figure.point)[:, :, None], force, axis=1)
        if axes != "global" and part.shape[1] == d:
            body = bodies.index(figure.on)
            turned = own.axes[:, body] if axes == "body" else own.turned[stack][:, place]
            part = np.einsum("tij,tir->tjr", turned, part)
        out[:, column, rows[figure.joint]] = part[:, figure.component]
    return out


def judged(
    held: Held, loads: Loads, B: np.ndarray, logged: np.ndarray, of: Kinds, rtol: float, doubt: np.ndarray
) -> Judgement:
    """What is right of a log.

    **Arguments:**

    - `B`: coefficients of figures, (times, figures, rows); `logged`: them, (times, figures).
    - `of`: what figures are.
    - `rtol`: what is right, relative to the largest load of the joint; `doubt`: of the multipliers, (times, m).
    """
    least = np.einsum("tfm,tm->tf", B, loads.multipliers)
    slack = np.abs(np.einsum("tfm,tm->tf", B, doubt))
    tolerance = _tolerance(least[loads.judged], logged[loads.judged], of, rtol) + slack
    stress, determined = np.zeros_like(least), np.zeros(least.shape, bool)
    for k, N in enumerate(loads.stress):
        if not loads.judged[k]:
            continue
        by = B[k] @ N
        sizes = np.linalg.norm(by, axis=1)
        whole = np.linalg.norm(B[k], axis=1)
        floor = np.array([whole[of.turns == kind].max(initial=0.0) for kind in of.turns])
        scaled_stress = np.linalg.norm(N, 2) if N.size else 0.0
        determined[k] = sizes <= _LOOSE * floor * scaled_stress
        by[determined[k]] = 0.0
        fit, z = (by / tolerance[k, :, None], (logged[k] - least[k]) / tolerance[k]), np.zeros(N.shape[1])
        if N.shape[1] and not determined[k].all():
            z = np.linalg.lstsq(*fit, rcond=1e-9)[0]
        if held.pushing:
            rows = list(held.pushing)
            contacts = ", ".join(held.system.rows.labels[row] for row in rows)
            said = f"At t = {loads.times[k]:.6g} the contacts {contacts}"
            z = pushed(z, (loads.multipliers[k, rows], N[rows]), fit, rtol, said)
        stress[k] = by @ z
    return Judgement(least, stress, logged - least - stress, determined, tolerance)


def _tolerance(least: np.ndarray, logged: np.ndarray, of: Kinds, rtol: float) -> np.ndarray:
    """Of each figure: `rtol` of the largest load of its joint, and a share of the largest of all, as logs have few
    digits; a moment counts as a force at the length of the machine."""
    sizes = np.array([np.linalg.norm(least[:, of.groups == group], axis=1).max(initial=0.0) for group in of.groups])
    lever = np.where(of.turns, of.length, 1.0)
    largest = max((sizes / lever).max(initial=0.0), of.weight) or float(np.abs(logged).max(initial=0.0)) or 1.0
    floor = _DIGITS * largest * lever
    rounding = _ROUNDING * np.abs(logged).max(axis=0, initial=0.0)
    return rtol * sizes + floor + rounding


def closed_loads(held: Held, path: Path, closure: AbstractClosure, B: np.ndarray, loads: Loads) -> np.ndarray:
    """Figures by a closure, NaN where it leaves them open or contacts would pull: lam_0 + N z with
    N^T W N z = N^T (d - W lam_0)."""
    system, pushing = held.system, list(held.pushing)
    out, count = np.full(B.shape[:2], np.nan), len(system.rows)
    given: list[np.ndarray] = []
    with computing():
        for k in np.flatnonzero(loads.judged).tolist():
            if not given or not closure.is_constant:
                state = State(path.q[k], path.qd[k], path.times[k])
                given = [np.asarray(x) for x in elasticity(closure, system, state)]
            (W, d), N, least = given, loads.stress[k], loads.multipliers[k]
            own = N[:count]
            inner = own.T @ W @ own
            if N.shape[1] and np.linalg.cond(inner) > 1 / _MASSLESS:
                continue
            z = np.linalg.solve(inner, own.T @ (d - W @ least[:count]))
            found = least + N @ z
            if np.all(found[pushing] >= -_ROUNDING * np.abs(found[pushing]).max(initial=0.0)):
                out[k] = B[k] @ found
    return out
