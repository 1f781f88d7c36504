"""Accelerations of MuJoCo's joints with loops as ideal constraints

    p = -S^+ (S' v),   N^T M N z = N^T (Q - bias - M p),   qdd = p + N z,   S N = 0

with the slopes S of the loops in the joint coordinates, S' by central differences of eighth order along v.
"""

import mujoco
import numpy as np

_WEIGHTS = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
_STEP = 1e-3


class IdealLoops:
    """A tree with its loops at positions of its joints, and a velocity that they allow, from a seed."""

    def __init__(self, tree, positions, seed=0):
        model, slopes = tree.description.origin.model, lambda at: tree.system(at)[1]
        model.opt.disableflags |= sum(
            getattr(mujoco.mjtDisableBit, f"mjDSBL_{word}") for word in ("CONTACT", "EQUALITY", "LIMIT", "ACTUATION")
        )
        for bound in (model.body_mass, model.body_inertia):
            bound[bound < 3e-14] = 0.0
        self.slopes = slopes(positions)
        self.motion = np.linalg.svd(self.slopes)[2][np.linalg.matrix_rank(self.slopes, tol=1e-9) :].T
        self.velocity = self.motion @ np.random.default_rng(seed).normal(size=self.motion.shape[1])
        along = [
            weight
            * (
                slopes(tree.moved(positions, k * _STEP * self.velocity))
                - slopes(tree.moved(positions, -k * _STEP * self.velocity))
            )
            for k, weight in _WEIGHTS
        ]
        data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        data.qpos[:], data.qvel[:] = positions, self.velocity
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        self.mass, self.data = mass, data
        self.prescribed = -np.linalg.lstsq(self.slopes, sum(along) @ self.velocity / _STEP, rcond=1e-9)[0]
        self.passive = data.qfrc_passive - data.qfrc_bias - mass @ self.prescribed

    def accelerations(self, applied=0.0):
        """Of the joints, under forces in them."""
        inert = self.motion.T @ self.mass @ self.motion
        return self.prescribed + self.motion @ np.linalg.solve(inert, self.motion.T @ (self.passive + applied))


def velocity_of_bodies(model, data, names):
    """Velocities of the centres of mass of bodies, and then their angular velocities in their own axes."""
    rates, spins = np.zeros((len(names), 6)), []
    for own, name in zip(rates, names, strict=True):
        body = model.body(name).id
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, own, 0)
        spins.append(data.xmat[body].reshape(3, 3).T @ own[:3])
    return np.concatenate([*rates[:, 3:], *spins])
