"""Mechanisms seen in turned axes."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import redundax as rx


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def turned(mechanism, state, angle):
    """A mechanism whose joints have the ground as body j, if at all, with its state and gravity, turned as a whole."""
    R, ground = rotation(angle), len(mechanism.names.bodies)
    for k, stack in enumerate(mechanism.joints):
        on_ground = np.asarray(stack.j) == ground
        with_normal = isinstance(stack.element, rx.Translational | rx.RackAndPinion)
        for name in ("point_j", "normal") if with_normal else ("point_j",):
            old = getattr(stack.element, name)
            new = jnp.where(on_ground[:, None], old @ R.T, old)
            mechanism = eqx.tree_at(lambda m, k=k, name=name: getattr(m.joints[k].element, name), mechanism, new)
        for kind, name in ((rx.Translational, "angle"), (rx.GearPair, "angle_j")):
            if isinstance(stack.element, kind):
                angles = getattr(stack.element, name) + np.where(on_ground, angle, 0.0)
                mechanism = eqx.tree_at(lambda m, k=k, name=name: getattr(m.joints[k].element, name), mechanism, angles)
    mechanism = eqx.tree_at(lambda m: m.gravity, mechanism, R @ mechanism.gravity)
    whole, linear = np.kron(np.eye(ground), R), slice(0, 2 * ground)
    q, qd = np.array(state.q), np.array(state.qd)
    q[linear], qd[linear] = whole @ q[linear], whole @ qd[linear]
    q[2 * ground :] += angle
    return mechanism, rx.State(q, qd)
