"""The same works in NumPy, as one would write them for this mechanism, and by the paper's formulas one by one."""

import numpy as np
from truth import paper

from ._measure import PHI, RATE


def data() -> dict[str, np.ndarray]:
    """A^+, b without friction, the effect of h, of unit friction moments, and the signed gains."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    matrix = paper.matrix(p, q)
    inverse = paper.pinv_drop_one(matrix)
    return {
        "inverse": inverse,
        "right": paper.right_side(p, q, qd),
        "shift": (np.eye(24) - inverse @ matrix).sum(axis=1),
        "spread": inverse[:, :12] @ paper.DISTRIBUTION,
        "gain": -p.mu_rho * paper.senses(qd),
    }


def looped(h: np.ndarray) -> np.ndarray:
    """The paper's fixed point (27), one h after the other; (batch, 24)."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    return np.stack([paper.fixed_point(p, q, qd, h=value)[-1] for value in h])


def vectorised(h: np.ndarray) -> np.ndarray:
    """Fixed point (27) on the full unknown for all h at once; (24, batch)."""
    d = data()
    base = (d["inverse"] @ d["right"])[:, None] + d["shift"][:, None] * h
    x, tau = base, np.zeros((4, h.size))
    for _ in range(1000):
        new = d["gain"][:, None] * np.hypot(x[12:20:2], x[13:20:2])
        x = base + d["spread"] @ new
        if np.max(np.abs(new - tau)) < 1e-12:
            break
        tau = new
    return x


def reduced(h: np.ndarray) -> np.ndarray:
    """The same with the eight loads alone in the loop; (24, batch)."""
    d = data()
    base = (d["inverse"] @ d["right"])[:, None] + d["shift"][:, None] * h
    loads, slope, tau = base[12:20], d["spread"][12:20], np.zeros((4, h.size))
    rho = loads
    for _ in range(1000):
        new = d["gain"][:, None] * np.sqrt(rho[0::2] ** 2 + rho[1::2] ** 2)
        rho = loads + slope @ new
        if np.max(np.abs(new - tau)) < 1e-12:
            break
        tau = new
    return base + d["spread"] @ new


def open_newton(x0: np.ndarray) -> np.ndarray:
    """Newton's iteration (38) with the pseudoinverse of a batch of matrices; x0 and result (batch, 24)."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    matrix, right = paper.matrix(p, q), paper.right_side(p, q, qd)
    gain, spread = -p.mu_rho * paper.senses(qd), np.zeros((24, 4))
    spread[:12] = paper.DISTRIBUTION
    x, going = np.array(x0), np.arange(len(x0))
    for _ in range(100):
        now = x[going]
        force = now[:, 12:20].reshape(-1, 4, 2)
        size = np.linalg.norm(force, axis=2)
        residual = now @ matrix.T - right - (gain * size) @ spread.T
        slope = np.zeros((len(now), 4, 24))
        for joint in range(4):
            slope[:, joint, 12 + 2 * joint : 14 + 2 * joint] = gain[joint] * force[:, joint] / size[:, joint, None]
        step = (np.linalg.pinv(matrix - spread @ slope, rcond=1e-11) @ residual[..., None])[..., 0]
        x[going] -= step
        going = going[(np.linalg.norm(residual, axis=1) > 1e-10) | (np.linalg.norm(step, axis=1) > 1e-10)]
        if going.size == 0:
            break
    return x


def frictionless(matrices: np.ndarray, rights: np.ndarray, rcond: float) -> np.ndarray:
    """x = A^+ b for a batch of matrices that are there already; (batch, 24)."""
    return (np.linalg.pinv(matrices, rcond=rcond) @ rights[..., None])[..., 0]


def fixed_point(matrices: np.ndarray, rights: np.ndarray, rcond: float) -> np.ndarray:
    """Fixed point (27) at h = 0 for a batch of matrices that are there already; (batch, 24)."""
    p = paper.Parameters()
    gain = -p.mu_rho * paper.senses(paper.configuration(p, PHI, RATE)[1])
    inverse = np.linalg.pinv(matrices, rcond=rcond)
    base, spread = (inverse @ rights[..., None])[..., 0], inverse[:, :, :12] @ paper.DISTRIBUTION
    x, tau = base, np.zeros((len(base), 4))
    for _ in range(1000):
        new = gain * np.hypot(x[:, 12:20:2], x[:, 13:20:2])
        x = base + (spread @ new[..., None])[..., 0]
        if np.max(np.abs(new - tau)) < 1e-12:
            break
        tau = new
    return x


def equations(parameters: list[paper.Parameters]) -> tuple[np.ndarray, np.ndarray]:
    """A and b without friction of many mechanisms, outside of what is timed."""
    out = [], []
    for p in parameters:
        q, qd = paper.configuration(p, PHI, RATE)
        out[0].append(paper.matrix(p, q))
        out[1].append(paper.right_side(p, q, qd))
    return np.stack(out[0]), np.stack(out[1])
