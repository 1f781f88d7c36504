"""Forces of the six motors of a Stewart platform, against MuJoCo's own inertias and bias along its closed-form motion.

    (dl/dx)^T f = (dq/dx)^T (M a + bias)

for the six velocities x of the platform, q being all joints of the tree, whose legs follow from where the platform is.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

mujoco = pytest.importorskip("mujoco")
LEGS, LENGTH, HEIGHT = 6, 0.3, 0.55  # of the lower half of a leg and of the platform at the start, m
TURNS = np.pi / 3 * np.arange(LEGS)
BASE = np.stack([np.cos(TURNS + 0.4 * (-1) ** np.arange(LEGS)), np.sin(TURNS + 0.4 * (-1) ** np.arange(LEGS))], axis=1)
BASE = np.concatenate([0.4 * BASE, np.zeros((LEGS, 1))], axis=1)
TOP = np.stack([np.cos(TURNS - 0.3 * (-1) ** np.arange(LEGS)), np.sin(TURNS - 0.3 * (-1) ** np.arange(LEGS))], axis=1)
TOP = np.concatenate([0.2 * TOP, np.zeros((LEGS, 1))], axis=1)


def platform(t, xp=np):
    """Where the platform is, and its rotation, at a time."""
    r = xp.stack([0.05 * xp.sin(2 * t), 0.04 * xp.sin(3 * t), HEIGHT + 0.05 * xp.sin(2.5 * t)])
    angle, (x, y, z) = 0.3 * xp.sin(1.7 * t), np.array([2.0, -1.0, 2.0]) / 3
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return r, xp.eye(3) + xp.sin(angle) * skew + (1 - xp.cos(angle)) * skew @ skew


def lengths(t):
    """Travel of each leg, from the start on."""
    r, turn = platform(t, jnp)
    first = np.linalg.norm(TOP + np.array([0, 0, HEIGHT]) - BASE, axis=1)
    return jnp.linalg.norm(r + TOP @ turn.T - BASE, axis=1) - first


def frames():
    """Axes of each leg at the start: z along it."""
    for base, top in zip(BASE, TOP + np.array([0, 0, HEIGHT]), strict=True):
        z = (top - base) / np.linalg.norm(top - base)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        yield base, np.stack([x, np.cross(z, x), z], axis=1), float(np.linalg.norm(top - base))


def model():
    """MJCF: universal joints below, slides, balls above."""
    bodies, loops = "", ""
    for k, (base, axes, length) in enumerate(frames()):
        x, y, z = axes.T
        place = " ".join(map(repr, base.tolist()))
        words = {name: " ".join(map(repr, axis.tolist())) for name, axis in zip("xyz", (x, y, z), strict=True)}
        low, high = (" ".join(map(repr, (at * z).tolist())) for at in (LENGTH / 2, length - LENGTH / 2))
        bodies += f"""<body name="lower{k}" pos="{place}"><joint name="a{k}" axis="{words["x"]}"/>
          <joint name="b{k}" axis="{words["y"]}"/><inertial pos="{low}" mass="1.5" diaginertia="0.02 0.03 0.04"/>
          <body name="upper{k}"><joint name="s{k}" type="slide" axis="{words["z"]}"/>
          <inertial pos="{high}" mass="0.7" diaginertia="0.01 0.02 0.015"/></body></body>"""
        anchor = " ".join(map(repr, (length * z).tolist()))
        loops += f'<connect name="ball{k}" body1="upper{k}" body2="platform" anchor="{anchor}"/>'
    return f"""<mujoco><worldbody>{bodies}<body name="platform" pos="0 0 {HEIGHT}"><freejoint name="free"/>
      <inertial pos="0.01 0.02 0.03" mass="5" diaginertia="0.1 0.12 0.2"/></body></worldbody>
      <equality>{loops}</equality></mujoco>"""


def joints(r, turn):
    """Angles and travel of each leg, six times three, for a position of the platform."""
    found = []
    for (base, axes, length), top in zip(frames(), TOP, strict=True):
        x, y, z = axes.T @ (r + turn @ top - base)  # = rot_x(a) rot_y(b) (0, 0, whole)
        whole = np.sqrt(x * x + y * y + z * z)
        found += [np.arctan2(-y, z), np.arcsin(x / whole), whole - length]
    return np.array(found)


def derivatives(path, step):
    """Of a path at 0, by the polynomial through nine points."""
    at = step * np.arange(-4, 5)
    poly = np.polyfit(at / step, np.array([path(s) for s in at]), 8)
    return poly[8], poly[7] / step, 2 * poly[6] / step**2


def turned(vector):
    """The rotation by a rotation vector."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / (angle or 1.0)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


@pytest.mark.slow
def test_motors_of_a_stewart_platform_push_as_mujocos_equations_say(tmp_path):
    path = tmp_path / "stewart.xml"
    path.write_text(model())
    ts = np.linspace(0.0, 1.5, 16)
    laws = {f"s{k}.travel": lambda t, k=k: lengths(t)[k] for k in range(LEGS)}
    loaded = rx.load_model(path)
    run = rx.drive(loaded.mechanism, laws, ts)
    forces = np.stack([np.asarray(run[f"s{k}.travel force"]) for k in range(LEGS)], axis=1)
    own = mujoco.MjModel.from_xml_path(str(path))
    own.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(own)
    travels = 3 * np.arange(LEGS) + 2
    for t, found in zip(ts, forces, strict=True):
        q, qd, qdd = derivatives(lambda s, t=t: joints(*platform(t + s)), 1e-2)
        r, v, a = derivatives(lambda s, t=t: platform(t + s)[0], 1e-2)
        turn, rate, change = derivatives(lambda s, t=t: platform(t + s)[1].ravel(), 1e-2)
        turn, rate, change = (each.reshape(3, 3) for each in (turn, rate, change))
        spin = turn.T @ rate  # of own axes
        grow = turn.T @ change - spin @ spin
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        data.qpos = np.r_[q, r, quaternion]
        data.qvel, data.qacc = (
            np.r_[one, two, three[2, 1], three[0, 2], three[1, 0]]
            for one, two, three in ((qd, v, spin), (qdd, a, grow))
        )
        mujoco.mj_inverse(own, data)
        ways = [lambda s, e=e, r=r, turn=turn: joints(r + s * e, turn) for e in np.eye(3)]
        ways += [lambda s, e=e, r=r, turn=turn: joints(r, turn @ turned(s * e)) for e in np.eye(3)]
        slopes = np.array([derivatives(way, 1e-2)[1] for way in ways])
        right = np.concatenate([slopes, np.eye(6)], axis=1) @ data.qfrc_inverse
        wanted = np.linalg.solve(slopes[:, travels], right)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())
