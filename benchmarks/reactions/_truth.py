"""The truth, in 50 digits, of equations that know nothing of redundax

At rest M a + J^T lam = Q, J a = 0 with velocities of centres and turns in global axes. Each joint locks the relative
motion of its point, and turns, along orthonormal directions; its load on body i is the force and moment that these
multipliers make. With J = U S V^T, Z its null space and N that of J^T,

    a = Z (Z^T M Z)^-1 Z^T Q,   lam = J^+T (Q - M a) + N z,   N^T W lam = N^T d   with compliance W and misfit d.
"""

from typing import NamedTuple

import mpmath as mp
import numpy as np

from ._cases import GRAVITY, GROUND, Case, X, Y, cross, unit

TRANSLATION, ROTATION = mp.mpf("1e-8"), mp.mpf("1e-6")  # compliance of every joint, m/N and rad/(N m)
MISFIT = mp.mpf("1e-5")  # m, of every hinge along its axis, either way
_RANK = mp.mpf(10) ** -35


class Truth(NamedTuple):
    """Of a case, exact but for the last rounding to float: redundancy, freedom; by joint force and moment on body i,
    global, of least norm and by the compliance, and which are unique, all (6,); and the largest axial force of the
    first hinge that misfits make with the compliance, by its least and largest."""

    redundancy: int
    freedom: int
    least: dict[str, np.ndarray]
    elastic: dict[str, np.ndarray]
    unique: dict[str, np.ndarray]
    band: tuple[float, float] | None


def directions(kind: str, axis: tuple) -> list[tuple[tuple, bool]]:
    """What a kind locks: a direction, and whether it is of a turn."""
    one = unit(cross(axis, X if mp.fabs(axis[0]) < mp.mpf("0.7") else Y))
    across = (one, cross(axis, one))
    moves = {"hinge": (*across, axis), "ball": (*across, axis), "fixed": (*across, axis)}.get(kind, across)
    turns = {"ball": (), "slide": (*across, axis), "fixed": (*across, axis)}.get(kind, across)
    return [*((each, False) for each in moves), *((each, True) for each in turns)]


def truth_of(case: Case) -> Truth:
    """The truth of a case."""
    names = list(case.bodies)
    n, rows = 6 * len(names), []
    mass, load = mp.zeros(n, n), mp.zeros(n, 1)
    for k, body in enumerate(case.bodies.values()):
        for axis in range(3):
            mass[6 * k + axis, 6 * k + axis], load[6 * k + axis] = body.mass, body.mass * GRAVITY[axis]
            mass[6 * k + 3 + axis, 6 * k + 3 + axis] = body.inertia[axis]
    compliance, loads, owners = [], [], []
    for name, joint in case.joints.items():
        for along, turns in directions(joint.kind, joint.axis):
            row = [mp.mpf(0)] * n
            for body, sign in ((joint.i, 1), (joint.j, -1)):
                if body == GROUND:
                    continue
                first = 6 * names.index(body)
                arm = tuple(p - c for p, c in zip(joint.point, case.bodies[body].centre, strict=True))
                force, moment = ((0, 0, 0), along) if turns else (along, cross(arm, along))
                for axis in range(3):
                    row[first + axis] += sign * force[axis]
                    row[first + 3 + axis] += sign * moment[axis]
            rows.append(row)
            compliance.append(ROTATION if turns else TRANSLATION)
            loads.append([0, 0, 0, *along] if turns else [*along, 0, 0, 0])
            owners.append((name, turns, along))
    J = mp.matrix(rows)
    m = J.rows
    U, S, V = mp.svd_r(J, full_matrices=True)
    rank = sum(1 for s in S if s > _RANK * S[0])
    Z, N = V[rank:, :].T if rank < n else mp.zeros(n, 0), U[:, rank:] if rank < m else mp.zeros(m, 0)
    a = mp.zeros(n, 1)
    if rank < n:
        a = Z * mp.lu_solve(Z.T * mass * Z, Z.T * load)
    rest = V[:rank, :] * (load - mass * a)
    lam = U[:, :rank] * mp.matrix([rest[k] / S[k] for k in range(rank)])
    elastic, band = lam, None
    if rank < m:
        W = mp.diag(compliance)
        inner = N.T * W * N
        elastic = lam - N * mp.lu_solve(inner, N.T * (W * lam))
        band = _band(case, owners, elastic, N, inner)
    projector = N * N.T if rank < m else mp.zeros(m, m)
    return Truth(
        m - rank,
        n - rank,
        _by_joint(case, owners, loads, lam),
        _by_joint(case, owners, loads, elastic),
        {name: _unique(owners, loads, projector, name) for name in case.joints},
        band,
    )


def _by_joint(case: Case, owners: list, loads: list, lam: mp.matrix) -> dict[str, np.ndarray]:
    """Force and moment on body i: minus J^T lam."""
    found = {}
    for name in case.joints:
        total = [mp.mpf(0)] * 6
        for k, (own, _, _) in enumerate(owners):
            if own == name:
                total = [x - lam[k] * y for x, y in zip(total, loads[k], strict=True)]
        found[name] = np.array([float(x) for x in total])
    return found


def _unique(owners: list, loads: list, projector: mp.matrix, name: str) -> np.ndarray:
    """Components that no self-stress reaches."""
    own = [k for k, (of, _, _) in enumerate(owners) if of == name]
    found = []
    for axis in range(6):
        reach = [sum(loads[k][axis] * projector[k, column] for k in own) for column in range(projector.rows)]
        found.append(mp.sqrt(sum(x * x for x in reach)) < mp.mpf(10) ** -25)
    return np.array(found)


def _band(case: Case, owners: list, elastic: mp.matrix, N: mp.matrix, inner: mp.matrix) -> tuple[float, float] | None:
    """lam = elastic + N inner^-1 N^T d with each axial misfit d of a hinge within +- MISFIT: both ends are attained."""
    hinges = [name for name, joint in case.joints.items() if joint.kind == "hinge"]
    if not hinges:
        return None
    axial = {
        of: k
        for k, (of, turns, along) in enumerate(owners)
        if of in hinges and not turns and along == case.joints[of].axis
    }
    response = N * mp.inverse(inner) * N.T
    first = axial[hinges[0]]
    width = sum(mp.fabs(response[first, k]) for k in axial.values()) * MISFIT
    return float(elastic[first] - width), float(elastic[first] + width)
