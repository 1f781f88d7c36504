"""Play beside one-sided contacts in motions: a sledge on supports, against trial of all sides and SciPy."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from sliding import check_slide

import redundax as rx

MASS, DEEP, MU = 2.0, -0.2, 0.3
SUPPORTS, WALLS, FOOT = (-0.5, 0.1, 0.6), (-0.1, 0.15), 0.35
SOFT, MISFIT, PLAY = (1e-6, 2e-6, 1.5e-6), (3e-5, -2e-5, 1e-5), (4e-5, 2e-5, 6e-5)


def sledge(contacts, along, mu=None):
    """It slides along x on supports that hold it both ways, and contacts, under a force and a moment of time."""

    def wrench(i, j, t, p):
        force = jnp.stack([along + 0.0 * t, -30.0 * jnp.cos(6.0 * t)])
        return rx.Wrench(force, 8.0 * jnp.sin(9.0 * t)), rx.Wrench(0.0 * force, 0.0 * t)

    feet = [_foot(f"s{k}", x, mu) for k, x in enumerate(SUPPORTS)]
    return rx.Mechanism([rx.Body("sledge", MASS, 0.3)], [*feet, *contacts], loads=[rx.LoadFunction("sledge", wrench)])


def _foot(name, x, mu, **kind):
    return rx.PinInSlot(name, "sledge", "ground", (x, DEEP), (x, DEEP), (0.0, 1.0), mu and rx.Coulomb(mu), **kind)


def closure(mechanism, contacts, play):
    """That of the supports, and of contacts with compliance and misfit along x and y."""
    figures = enumerate(zip(SOFT, MISFIT, strict=True))
    soft = [rx.JointCompliance(f"s{k}", w, misfit=(0.0, d, 0.0)) for k, (w, d) in figures]
    soft += [rx.JointCompliance(name, w, misfit=(*d, 0.0)) for name, (w, d) in contacts.items()]
    return rx.ElasticJoints(mechanism, soft, play={**{f"s{k}": c for k, c in enumerate(PLAY)}, **play})


def loads_at(t, along, contacts=(), mu=0.0):
    """Loads N at the one set of sides that fits, of supports and of contacts, given as (direction of the force on the
    sledge and its arm, w, d, c): N along J with J^T N = -Q, w N = d + J u - c n where one carries, |d + J u| <= c
    elsewhere, and d + J u <= c of contacts."""
    rows = [((0.0, 1.0, x), w, -d, c) for x, w, d, c in zip(SUPPORTS, SOFT, MISFIT, PLAY, strict=True)]
    directions, soft, misfit, play = map(np.array, zip(*rows, *contacts, strict=True))
    k, found = len(directions), []
    for side in itertools.product(*[(-1.0, 0.0, 1.0)] * 3, *[(0.0, 1.0)] * len(contacts)):
        n = np.array(side)
        matrix, right = np.zeros((k + 3, k + 3)), np.zeros(k + 3)
        matrix[:k, :k] = np.diag(np.where(n != 0, soft, 1.0))
        matrix[:k, k:] = np.where(n[:, None] != 0, -directions, 0.0)
        right[:k] = np.where(n != 0, misfit - play * n, 0.0)
        matrix[k:, :k] = directions.T
        matrix[-1, :k] -= DEEP * mu * -n * (directions[:, 0] == 0)  # friction -mu |N| below the centre turns it
        right[k:] = -along, 30.0 * np.cos(6.0 * t), -8.0 * np.sin(9.0 * t)
        if not directions[:, 0].any():  # free along x
            matrix[k, k], right[k] = 1.0, 0.0
        if np.linalg.cond(matrix / np.abs(matrix).max(axis=1)[:, None]) > 1e12:
            continue
        loads, u = np.split(np.linalg.solve(matrix, right), [k])
        gap, one_sided = misfit + directions @ u, np.arange(k) > 2
        fits = np.where(n != 0, loads * n > 0, (gap <= play) & ((gap >= -play) | one_sided))
        if np.all(fits):
            found.append(loads)
    (loads,) = found
    return loads


@pytest.mark.slow
def test_a_sledge_with_play_strikes_two_walls():
    """Of two walls one loses its load, as the sledge crosses the clearance of a support, and gets it again."""
    along, figures = 20.0, {"w0": (1e-6, (0.0, 0.0)), "w1": (1.2e-6, (1e-5, 0.0))}
    walls = [
        rx.PinInSlot(f"w{k}", "sledge", "ground", (0.7, y), (1.7, y), (-1.0, 0.0), one_sided=True)
        for k, y in enumerate(WALLS)
    ]
    mechanism = sledge(walls, along)
    joints = closure(mechanism, figures, {"w1": 1e-5})
    start, ts = rx.State(jnp.zeros(3), jnp.array([2.0, 0.0, 0.0])), np.linspace(0.0, 1.2, 13)
    motion = rx.simulate(mechanism, start, 1.2, closure=joints, ts=ts)
    strikes = (np.sqrt(24.0) - 2.0) / (along / MASS)  # 2 t + 5 t^2 = 1
    np.testing.assert_allclose(motion.impacts.t, [strikes], rtol=1e-12)
    np.testing.assert_allclose(motion.impacts.energy, [24.0], rtol=1e-12)
    np.testing.assert_allclose(motion.q[:, 0], np.where(ts < strikes, 2 * ts + 5 * ts**2, 1.0), rtol=1e-12)
    soft = (1e-6, 0.0, 0.0), (1.2e-6, 1e-5, 1e-5)
    stopped = [((-1.0, 0.0, y), *figures) for y, figures in zip(WALLS, soft, strict=True)]
    for k, t in enumerate(ts):
        loads = loads_at(t, along, stopped) if t > strikes else np.append(loads_at(t, 0.0), [0.0, 0.0])
        np.testing.assert_allclose(motion.multipliers[k], loads, rtol=1e-9, atol=1e-9)
        does = np.where(t < strikes, "open", np.where(loads[3:] > 0, "carries", "touches"))
        assert [motion.contacts["w0"][k], motion.contacts["w1"][k]] == does.tolist()
    assert {"open", "carries", "touches"} == set(motion.contacts["w1"])


@pytest.mark.slow
def test_a_sledge_with_play_and_a_foot_slides_to_a_stop():
    """Its friction reads the loads that play leaves, also those of the foot, which has play downwards."""
    along, figures = 1.0, {"foot": (1e-6, (0.0, 5e-6))}
    mechanism = sledge([_foot("foot", FOOT, MU, one_sided=True)], along, MU)
    joints, foot = closure(mechanism, figures, {"foot": 1e-5}), [((0.0, 1.0, FOOT), 1e-6, -5e-6, 1e-5)]
    start = rx.State(jnp.zeros(3), jnp.array([2.0, 0.0, 0.0]))
    motion = rx.simulate(mechanism, start, 1.0, closure=joints, ts=np.linspace(0, 1, 21), rtol=1e-10)
    slides = check_slide(motion, lambda t: (along - MU * np.sum(np.abs(loads_at(t, 0.0, foot, MU)))) / MASS)
    loads = np.array([loads_at(float(t), 0.0, foot, MU) for t in motion.t[slides]])
    np.testing.assert_allclose(motion.multipliers[slides], loads, rtol=1e-9, atol=1e-9)
    assert 0 < np.count_nonzero(loads[:, 3]) < len(loads)
