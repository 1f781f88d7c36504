"""Forces of the motors of robots, against inertias and bias of MuJoCo, and of Pinocchio where it is installed.

A tree needs tau = M a + bias: recursive Newton-Euler. Of closed loops, whose trees follow from few numbers x,

    (du/dx)^T f = (dq/dx)^T (M a + bias)

for the coordinates u of the motors among all joints q of the tree. Positions are closed forms; their derivatives are
those of polynomials through nine points.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

mujoco = pytest.importorskip("mujoco")


def derivatives(path, step=1e-2):
    """Of a path at 0: value, first and second."""
    at = step * np.arange(-4, 5)
    poly = np.polyfit(at / step, np.array([path(s) for s in at]), 8)
    return poly[8], poly[7] / step, 2 * poly[6] / step**2


def opened(path):
    """MuJoCo's model of a file without its loops."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model, mujoco.MjData(model)


def forces(path, joints, motion, t, motors, still=()):
    """What the motors give at a time, for joints(x) and x(t); coordinates of position alone, `still`, go last."""
    model, data = opened(path)
    q, qd, qdd = derivatives(lambda s: joints(motion(t + s)))
    none = np.zeros(model.nv - q.size)
    data.qpos, data.qvel, data.qacc = np.r_[q, still], np.r_[qd, none], np.r_[qdd, none]
    mujoco.mj_inverse(model, data)
    x = motion(t)
    slopes = np.array([derivatives(lambda s, e=e: joints(x + s * e), 1e-3)[1] for e in np.eye(x.size)])
    return np.linalg.solve(slopes[:, motors], slopes @ data.qfrc_inverse[: q.size])


# A serial arm -------------------------------------------------------------------------------------------------

AXES = ("0 0 1", "0 1 0", "0.6 0.8 0", "1 0 0", "0 0.8 -0.6", "0 0 1")
SWINGS = np.array([[0.6, 0.5, 0.4, 0.8, 0.3, 0.9], [1.0, 1.3, 1.7, 2.1, 0.7, 2.9], [0.0, 0.4, 0.9, 0.2, 1.5, 0.7]])


def arm():
    """URDF: six hinges on axes of all kinds, bodies whose principal axes are askew."""
    links = '<link name="l0"/>'
    for k, axis in enumerate(AXES, start=1):
        links += f"""<link name="l{k}"><inertial><origin xyz="0.0{k} 0.02 0.1" rpy="0.1 0.{k} 0.3"/>
          <mass value="{4 / k}"/><inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="-0.003"/>
          </inertial></link>
          <joint name="j{k}" type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/>
          <origin xyz="0.05 0 0.2" rpy="0.2 -0.1 0.3"/><axis xyz="{axis}"/></joint>"""
    return f'<robot name="arm">{links}</robot>'


@pytest.mark.slow
def test_a_serial_arm_needs_what_recursive_newton_euler_says(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(arm())
    size, rate, phase = SWINGS
    laws = {f"j{k + 1}.angle": lambda t, k=k: size[k] * jnp.sin(rate[k] * t + phase[k]) for k in range(6)}
    ts = np.linspace(0.0, 1.2, 13)
    run = rx.drive(rx.load_model(path).mechanism, laws, ts)
    found = np.stack([np.asarray(run[f"j{k}.angle torque"]) for k in range(1, 7)], axis=1)
    turn = rate * ts[:, None] + phase
    q, qd, qdd = size * np.sin(turn), size * rate * np.cos(turn), -size * rate**2 * np.sin(turn)
    model, data = opened(path)
    wanted = []
    for data.qpos, data.qvel, data.qacc in zip(q, qd, qdd, strict=True):
        mujoco.mj_inverse(model, data)
        wanted.append(data.qfrc_inverse.copy())
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    try:
        import pinocchio
    except ImportError:
        return
    model = pinocchio.buildModelFromXML(arm())
    turns = [np.stack([np.cos(each), np.sin(each)], axis=1).ravel() for each in q]  # of hinges without limits
    wanted = [pinocchio.rnea(model, model.createData(), *each) for each in zip(turns, qd, qdd, strict=True)]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())


# A planar five-bar --------------------------------------------------------------------------------------------

BASE, CRANK, ROD, FIRST = 0.3, 0.25, 0.35, np.array([2.2, 0.9])  # m; rad of the cranks at the start


def five_bar_angles(cranks):
    """Of the tree, from the start on: crank and rod of the left side, then of the right."""

    def whole(cranks):
        tips = np.array([[0.0, 0.0], [BASE, 0.0]]) + CRANK * np.stack([np.cos(cranks), np.sin(cranks)], axis=1)
        way = tips[1] - tips[0]
        out = np.arccos(np.hypot(*way) / (2 * ROD))
        first = np.arctan2(way[1], way[0]) + out
        end = tips[0] + ROD * np.array([np.cos(first), np.sin(first)])
        rods = np.array([first, np.arctan2(*(end - tips[1])[::-1])])
        return np.stack([cranks, rods - cranks], axis=1).ravel()

    return whole(cranks + FIRST) - whole(FIRST)


def five_bar():
    """MJCF: two cranks and two rods whose ends are one point."""
    bodies, end = "", None
    for k, (pivot, crank) in enumerate(zip((0.0, BASE), FIRST, strict=True)):
        tip = CRANK * np.array([np.cos(crank), np.sin(crank)])
        other = np.array([BASE - 2 * pivot, 0.0]) + CRANK * np.array([np.cos(FIRST[1 - k]), np.sin(FIRST[1 - k])]) - tip
        out = np.arccos(np.hypot(*other) / (2 * ROD)) * (1, -1)[k]
        rod = ROD * np.array([np.cos(np.arctan2(*other[::-1]) + out), np.sin(np.arctan2(*other[::-1]) + out)])
        end = rod if end is None else end
        bodies += f"""<body pos="{pivot} 0 0" name="crank{k}"><joint name="A{k}" axis="0 0 1"/>
          <inertial pos="{tip[0] / 2} {tip[1] / 2} 0" mass="0.8" diaginertia="0.001 0.002 0.003"/>
          <body pos="{tip[0]} {tip[1]} 0" name="rod{k}"><joint name="B{k}" axis="0 0 1"/>
          <inertial pos="{rod[0] / 3} {rod[1] / 3} 0" mass="0.5" diaginertia="0.002 0.003 0.004"/></body></body>"""
    return f"""<mujoco><option gravity="0 -9.81 0"/><worldbody>{bodies}</worldbody><equality>
      <connect body1="rod0" body2="rod1" anchor="{end[0]} {end[1]} 0"/></equality></mujoco>"""


@pytest.mark.slow
def test_motors_of_a_five_bar_turn_as_mujocos_equations_say(tmp_path):
    path = tmp_path / "five_bar.xml"
    path.write_text(five_bar())

    def cranks(t, xp=np):
        return xp.stack([0.4 * xp.sin(2 * t), 0.3 * xp.sin(3 * t) + 0.2 * t])

    ts = np.linspace(0.0, 1.5, 16)
    laws = {f"A{k}.angle": lambda t, k=k: cranks(t, jnp)[k] for k in range(2)}
    run = rx.drive(rx.load_model(path).mechanism, laws, ts)
    found = np.stack([np.asarray(run[f"A{k}.angle torque"]) for k in range(2)], axis=1)
    wanted = [forces(path, five_bar_angles, cranks, t, [0, 2]) for t in ts]
    assert np.all(run.determined)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


# A delta robot ------------------------------------------------------------------------------------------------

UPPER, FORE, HALF, DEPTH = 0.2, 0.45, 0.06, -0.4  # m: arm, rods, half their distance, and the platform below
TURNS = 2 * np.pi / 3 * np.arange(3)
OUT = np.stack([np.cos(TURNS), np.sin(TURNS), np.zeros(3)], axis=1)  # radial, and along the axes of motors
ALONG = np.stack([-np.sin(TURNS), np.cos(TURNS), np.zeros(3)], axis=1)
SHOULDER, WRIST = 0.15, 0.05
DOWN = np.array([0.0, 0.0, 1.0])


def motor_angles(x, xp=np):
    """Down from the horizontal, of the three arms, for the centre of the platform."""
    found = []
    for out, along in zip(OUT, ALONG, strict=True):
        to = x + (WRIST - SHOULDER) * out  # of the wrist's middle from the shoulder
        a, b, c = to @ out, -to @ DOWN, to @ along
        reach = (UPPER**2 + a * a + b * b + c * c - FORE**2) / (2 * UPPER)
        found.append(xp.arctan2(b, a) - xp.arccos(reach / xp.sqrt(a * a + b * b)))
    return xp.stack(found)


def turn_about(axis, angle):
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def elbow(k, angle):
    return SHOULDER * OUT[k] + UPPER * (np.cos(angle) * OUT[k] - np.sin(angle) * DOWN)


START = np.array([0.0, 0.0, DEPTH])


def rod_frame(k):
    """Axes of the rods of an arm at the start: z along them."""
    z = START + WRIST * OUT[k] - elbow(k, motor_angles(START)[k])
    z /= np.linalg.norm(z)
    x = np.cross(ALONG[k], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def delta_joints(x):
    """Each arm, with the two angles of each of its rods, and where the platform is from the start on."""
    found, angles, first = [], motor_angles(x), motor_angles(START)
    for k in range(3):
        way = x + WRIST * OUT[k] - elbow(k, angles[k])
        back = turn_about(ALONG[k], angles[k] - first[k]).T  # both rods are parallel
        a, b, c = rod_frame(k).T @ (back @ way)
        found += [angles[k] - first[k], *2 * [np.arctan2(-b, c), np.arcsin(a / FORE)]]
    return np.concatenate([found, x])


def delta():
    """MJCF: an arm on each motor, two rods on universal joints, balls on the platform, which is free."""
    bodies, loops, words = "", "", lambda v: " ".join(map(repr, np.asarray(v).tolist()))
    for k, angle in enumerate(motor_angles(START)):
        frame, arm = rod_frame(k), elbow(k, angle) - SHOULDER * OUT[k]
        x, y, z = frame.T
        rods = ""
        for name, side in (("p", HALF), ("m", -HALF)):
            rods += f"""<body name="rod{k}{name}" pos="{words(arm + side * ALONG[k])}">
              <joint name="u{k}{name}" axis="{words(x)}"/><joint name="v{k}{name}" axis="{words(y)}"/>
              <inertial pos="{words(FORE / 2 * z)}" mass="0.15" diaginertia="0.002 0.003 0.001"/></body>"""
            loops += f'<connect body1="rod{k}{name}" body2="platform" anchor="{words(FORE * z)}"/>'
        bodies += f"""<body name="arm{k}" pos="{words(SHOULDER * OUT[k])}"><joint name="M{k}" axis="{words(ALONG[k])}"/>
          <inertial pos="{words(0.4 * arm)}" mass="0.6" diaginertia="0.003 0.004 0.002"/>{rods}</body>"""
    return f"""<mujoco><worldbody>{bodies}<body name="platform" pos="{words(START)}"><freejoint name="free"/>
      <inertial pos="0.01 0.02 -0.01" mass="0.9" diaginertia="0.002 0.003 0.004"/></body></worldbody>
      <equality>{loops}</equality></mujoco>"""


@pytest.mark.slow
def test_motors_of_a_delta_robot_turn_as_mujocos_equations_say(tmp_path):
    path = tmp_path / "delta.xml"
    path.write_text(delta())

    def platform(t, xp=np):
        return xp.stack([0.08 * xp.sin(3 * t), 0.06 * xp.sin(2 * t), DEPTH + 0.05 * xp.sin(4 * t)])

    ts, first = np.linspace(0.0, 1.5, 16), motor_angles(START)
    laws = {f"M{k}.angle": lambda t, k=k: motor_angles(platform(t, jnp), jnp)[k] - first[k] for k in range(3)}
    run = rx.drive(rx.load_model(path).mechanism, laws, ts)
    found = np.stack([np.asarray(run[f"M{k}.angle torque"]) for k in range(3)], axis=1)
    wanted = [forces(path, delta_joints, platform, t, [0, 5, 10], still=(1.0, 0.0, 0.0, 0.0)) for t in ts]
    centre = np.array([platform(t) for t in ts]) + np.array([0.01, 0.02, -0.01])
    np.testing.assert_allclose(run.centres[:, -3:], centre, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
