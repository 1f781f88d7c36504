"""Motions with contacts beside MuJoCo, whose contacts give way, and less where its steps are shorter.

Positions and times of events agree to what it is off by.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.slow
G = 9.81
HARD = 'solimp="0.9999 0.9999 0.001"'
FLAT = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint axis="0 0 1"/>'
DAMPING = 0.2  # of a contact that bounces: it is left where its force is zero, before its spring is as long as at first
BOUNCE = np.exp(-DAMPING / np.sqrt(1 - DAMPING**2) * (np.pi - 2 * np.arcsin(DAMPING)))


def spring(time, damping=1.0):
    """A contact of a time constant and a damping ratio, negative as a stiffness and a damping."""
    return f'solref="{-1 / time**2} {-2 * damping / time}"'


def limits(time, damping=1.0):
    """The same of a joint or a cable."""
    return f"{spring(time, damping)} {HARD}".replace("=", "limit=")


def scene(bodies, more="", upwards="0 1 0", integrator="implicitfast"):
    """A model with a floor, on which nothing touches but what is said."""
    gravity = " ".join(str(-G * float(x)) for x in upwards.split())
    return f"""<mujoco><option gravity="{gravity}" cone="elliptic" integrator="{integrator}" tolerance="1e-14"/>
      <default><geom contype="0" conaffinity="0"/></default><worldbody>
      <geom name="floor" type="plane" size="9 9 1" zaxis="{upwards}"/>{bodies}</worldbody>{more}</mujoco>"""


def points(places, size=1e-9):
    """Points of a body, as very small spheres."""
    return "".join(f'<geom name="f{k}" type="sphere" size="{size}" pos="{place}"/>' for k, place in enumerate(places))


def pairs(count, contact):
    """Contacts of points with the floor."""
    each = (f'<pair geom1="f{k}" geom2="floor" {HARD} {contact}/>' for k in range(count))
    return f"<contact>{''.join(each)}</contact>"


def stepped(model, step, end, begin=None, rates=None, load=None):
    """Times of all steps and positions there; `load(data)` sets forces."""
    model = mujoco.MjModel.from_xml_string(model)
    model.opt.timestep = step
    data = mujoco.MjData(model)
    data.qpos[:] = data.qpos if begin is None else begin
    data.qvel[:] = data.qvel if rates is None else rates
    path = np.empty((round(end / step) + 1, model.nq))
    for now in path:
        now[:] = data.qpos
        if load is not None:
            load(data)
        mujoco.mj_step(model, data)
    return step * np.arange(len(path)), path


def closes(times, gap, after=0.0):
    """When a gap closes for the first time after another."""
    k = np.flatnonzero((gap[:-1] > 0) & (gap[1:] <= 0) & (times[:-1] >= after))[0]
    return times[k] + (times[k + 1] - times[k]) * gap[k] / (gap[k] - gap[k + 1])


def agrees(ours, theirs, most):
    """Within `most` of the shorter steps, which are nearer than the longer ones by half at least."""
    coarse, fine = (np.abs(np.asarray(ours) - x).max() for x in theirs)
    assert fine <= most and 2 * fine <= coarse, (coarse, fine)


def at(times, path, asked):
    return path[np.round(np.asarray(asked) / times[1]).astype(int)]


def test_a_ball_bounces():
    ball = rx.System(
        lambda q, t, p: -q[1:],
        mass=jnp.array([2.0, 2.0]),
        load=lambda q, qd, t, p: jnp.array([0.0, -2.0 * G]),
        rows="force",
        m=1,
        one_sided=[0],
    )
    start = rx.State(jnp.array([0.0, 1.0]), jnp.array([1.0, 0.0]))
    motion = rx.simulate(ball, start, 1.5, restitution=BOUNCE, ts=[0.4, 0.8, 1.2, 1.5], max_phases=60)
    body = f'<body>{FLAT}<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>{points(["0 0 0"])}</body>'
    path, impacts = [], []
    for step, time in ((2e-5, 1e-3), (5e-6, 2.5e-4)):
        contact = pairs(1, f'condim="1" {spring(time, DAMPING)}')
        times, q = stepped(scene(body, contact, integrator="RK4"), step, 1.5, [0, 1, 0], [1, 0, 0])
        path.append(at(times, q, motion.t)[:, :2])
        impacts.append([closes(times, q[:, 1], after) for after in (0.0, 0.5, 1.0)])
    agrees(motion.impacts.t[:3], impacts, 2e-3)  # each takes 0.7 ms
    agrees(motion.q, path, 2e-3)


def test_a_pendulum_against_a_stop():
    pin = rx.Revolute("A", "rod", "ground", (0.0, 0.4), (0.0, 0.0))
    stop = rx.Stop("stop", "A.angle", most=0.3)
    pendulum = rx.Mechanism([rx.Body("rod", 1.5, 0.1)], [pin], couplers=[stop], gravity=(0.0, -G))
    start = rx.State(jnp.array([0.4 * np.sin(-0.8), -0.4 * np.cos(0.8), -0.8]), jnp.zeros(3))
    motion = rx.simulate(pendulum, start, 3.0, restitution=BOUNCE, ts=np.linspace(0.3, 3.0, 10))
    path, impacts = [], []
    for step, time in ((2e-5, 1e-3), (5e-6, 2.5e-4)):
        limit = f'limited="true" range="-3.14 0.3" {limits(time, DAMPING)}'
        body = f"""<body><joint axis="0 0 1" {limit}/>
          <inertial pos="0 -0.4 0" mass="1.5" diaginertia="0.1 0.1 0.1"/></body>"""
        times, q = stepped(f'<mujoco><compiler angle="radian"/>{scene(body, integrator="RK4")[8:]}', step, 3.0, [-0.8])
        path.append(at(times, q, motion.t)[:, 0])
        impacts.append([closes(times, 0.3 - q[:, 0], after) for after in np.asarray(motion.impacts.t) - 0.2])
    agrees(motion.impacts.t, impacts, 2e-3)
    agrees(motion["rod.phi"], path, 5e-3)


def test_a_cable_slackens_and_tightens():
    length, speed = 0.8, np.sqrt(3.5 * G * 0.8)
    cable = rx.Cable("rope", "bob", "ground", (0, 0), (0, 0), distance=length)
    bob = rx.Mechanism([rx.Body("bob", 2.0, 0.01)], [cable], gravity=(0, -G))
    start = rx.State(jnp.array([0.0, -length, 0.0]), jnp.array([speed, 0.0, 0.0]))
    motion = rx.simulate(bob, start, 1.3, ts=np.linspace(0.1, 1.3, 13))
    body = f"""<site name="a"/><body>{FLAT}<inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
      <site name="b"/></body>"""
    path, impacts = [], []
    for step in (2e-5, 4e-6):
        limit = f'limited="true" range="0 {length}" {limits(40 * step, 10.0)}'
        tendon = f'<tendon><spatial {limit}><site site="a"/><site site="b"/></spatial></tendon>'
        times, q = stepped(scene(body, tendon), step, 1.3, [0, -length, 0], [speed, 0, 0])
        path.append(at(times, q, motion.t))
        impacts.append(closes(times, length - np.linalg.norm(q[:, :2], axis=1), 0.7))
    agrees(motion.impacts.t[0], impacts, 1e-6)
    agrees(motion.q, path, 1e-5)


def test_feet_of_a_table_in_space_lift_and_land():
    top = rx.spatial.Body("table", 10.0, inertia=(0.8, 1.1, 1.5), centre=(0.0, 0.0, 0.7))
    corners = [(-0.4, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.4, 0.3)]
    feet = [
        rx.spatial.PointOnPlane(f"f{k}", top, "ground", (x, y, 0.0), axis=(0.0, 0.0, 1.0), one_sided=True)
        for k, (x, y) in enumerate(corners)
    ]

    def moment(t):
        return 168.0 * t * (1 - t)

    def tilts(i, j, t, p):
        turning = jnp.stack([0.0 * t, moment(t), 0.0 * t])
        return rx.spatial.Wrench(jnp.zeros(3), turning), rx.spatial.Wrench(jnp.zeros(3), -turning)

    load = rx.spatial.LoadFunction(top, tilts)
    table = rx.Mechanism([top], feet, loads=[load], gravity=(0.0, 0.0, -G))
    start = rx.State(jnp.array([0.0, 0.0, 0.7, 1.0, 0.0, 0.0, 0.0]), jnp.zeros(6))
    motion = rx.simulate(table, start, 1.1, ts=np.linspace(0.1, 1.1, 11))
    body = f"""<body><freejoint/><inertial pos="0 0 0" mass="10" diaginertia="0.8 1.1 1.5"/>
      {points([f"{x} {y} -0.7" for x, y in corners])}</body>"""

    def turn(data):
        data.xfrc_applied[1, 4] = moment(data.time)

    path, lands = [], []
    for step in (4e-5, 1e-5):
        contact = pairs(4, f'condim="1" {spring(40 * step, 10.0)}')
        times, q = stepped(scene(body, contact, "0 0 1"), step, 1.1, [0, 0, 0.7, 1, 0, 0, 0], load=turn)
        path.append(at(times, q, motion.t))
        tilt = 2 * np.arctan2(q[:, 5], q[:, 3])
        lands.append(closes(times, q[:, 2] + 0.4 * np.sin(tilt) - 0.7 * np.cos(tilt), 0.7))
    agrees(motion.impacts.t[0], lands, 1e-6)
    agrees(motion.q, path, 1e-6)


def test_a_block_is_pushed_slides_tips_lands_and_slides_to_rest():
    """Friction of MuJoCo ends slip within a time of its own: much more than a step, or feet hop as they slide, and no
    more than impacts take, or these have too little friction."""
    asked = [0.2, 0.3, 0.4, 0.5, 0.7, 0.8, 1.0]  # at 0.55 contacts of MuJoCo still give way

    def push(t, phi, xp):
        force = 32.0 * xp.exp(-(((t - 0.25) / 0.1) ** 2))
        return force, -0.2 * force * xp.cos(phi)

    def pushes(i, j, t, p):
        force, moment = push(t, i.pose.phi, jnp)
        return rx.Wrench(jnp.stack([force, 0.0 * t]), moment), rx.Wrench(jnp.zeros(2), 0.0 * t)

    feet = [
        rx.PinInSlot(name, "block", "ground", (x, -0.5), (0, 0), (0, 1), rx.Coulomb(0.3), one_sided=True)
        for name, x in (("f1", -0.3), ("f2", 0.3))
    ]
    load = rx.LoadFunction("block", pushes)
    block = rx.Mechanism([rx.Body("block", 3.0, 0.2)], feet, loads=[load], gravity=(0.0, -G))
    motion = rx.simulate(block, rx.State(jnp.array([0.0, 0.5, 0.0]), jnp.zeros(3)), 1.0, ts=asked)
    body = f"""<body>{FLAT}<inertial pos="0 0 0" mass="3" diaginertia="0.2 0.2 0.2"/>
      {points([f"{x} -0.5 0" for x in (-0.3, 0.3)], 1e-6)}</body>"""

    def pushed(data):
        force, moment = push(data.time, data.qpos[2], np)
        data.qfrc_applied[:] = [force, 0.0, moment]

    path, lands = [], []
    for step, time, slip in ((2e-5, 2e-3, 1e-3), (5e-6, 1e-3, 2.5e-4)):
        rubs = f'condim="3" friction="0.3 0.3" {spring(time)} solreffriction="-1e-9 {-1 / slip}"'
        times, q = stepped(scene(body, pairs(2, rubs)), step, 1.0, [0, 0.5, 0], load=pushed)
        path.append(at(times, q, motion.t))
        lands.append(closes(times, q[:, 1] - 0.3 * np.sin(q[:, 2]) - 0.5 * np.cos(q[:, 2]), 0.3))
    agrees(motion.impacts.t, lands, 5e-4)
    agrees(motion.q, path, 5e-4)
