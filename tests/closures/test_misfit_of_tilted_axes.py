"""Misfits of joints whose axes tilt: closed forms of first order for every joint, whatever the marks; and refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import redundax as rx
from redundax._bodies._space._rotation import axes_along

rs, G = rx.spatial, "ground"
TURNED = Rotation.from_rotvec([0.4, -0.9, 0.7]).as_matrix()
ORIGIN, POINT, SHIFT = np.array([[0.1, 0.2, -0.3], [0.3, -0.2, 0.1], [0.3, -0.5, 0.4]])
TRAVEL, LEAD, TWIST = 0.25, 0.1, 0.7
TILTS = np.array([0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 2e-4, 1e-2, 0.1])
ALONG = np.concatenate([np.eye(3), -np.eye(3)])
NEAR = ALONG[:, None] + 1e-6 * np.array([[1, 1, 0], [0, 1, 1], [-1, 0, 1]])  # where rounding might choose
OBLIQUE = np.array([[1, 1, 0], [1, 0, 1], [0, 1, -1], [1, 1, 1], [-3, 1, 2], [0.5, 0.1, -0.8], [0.88, 0.47, 0.05]])
AXES = np.concatenate([ALONG, NEAR.reshape(-1, 3), OBLIQUE])
AXES = AXES / np.linalg.norm(AXES, axis=1, keepdims=True)

# Of each kind its rows: shifts along x, y and z, turns about the axes by a, b and c, h of a thread, u of a cross and g
# of wheels; whether it stands TRAVEL along the axis; and what else it is made of.
KINDS = {
    "Revolute": ("xyzab", False, {}),
    "Cylindrical": ("xyab", True, {}),
    "Prismatic": ("xyabc", True, {}),
    "Screw": ("xyhab", False, {"pitch": 2 * np.pi * LEAD}),
    "Spherical": ("xyz", False, {}),
    "Planar": ("zab", False, {}),
    "Universal": ("xyzu", False, {}),
    "ConstantVelocity": ("xyzc", False, {}),
    "PointOnLine": ("xy", True, {}),
    "PointOnPlane": ("z", False, {}),
    "ParallelAxes": ("ab", False, {}),
    "Fixed": ("xyzabc", False, {}),
    "AngleDriver": ("c", False, {"angle": 0.0}),
    "TravelDriver": ("z", True, {"travel": TRAVEL}),
    "Gear": ("g", False, {"teeth": (20, 30)}),
}
RADIUS = 0.6  # distance of the wheels


def expected(axis, mark, direction):
    """Rows of each kind, to be taken one by one, of first order in a tilt about `direction`, square to the axis."""
    axes = np.stack([mark, np.cross(axis, mark), axis], axis=1)
    (ex, ey, ez), (about_x, about_y, _) = SHIFT @ axes, direction @ axes
    rows = {"z": -ez, "a": -about_x, "b": -about_y, "c": -TWIST, "h": -ez + LEAD * TWIST, "u": about_y}
    rows["g"] = -2.5 * ey / RADIUS + 1.5 * TWIST
    found = {}
    for kind, (names, slid, _) in KINDS.items():
        lever = TRAVEL if slid else 0.0
        own = rows | {"x": -ex - lever * about_y, "y": -ey + lever * about_x}
        found[kind] = iter([own[name] for name in names])
    return found


def machine(axis, mark, direction, size=0.0, turn=0.0):
    """All joints at one place between a body and the ground, whose side is shifted and tilted by `size`; the marks on
    both turned by `turn` where they are free, and that on the ground by a share of `size` besides."""
    body = rs.Body("body", 1.0, (0.1, 0.1, 0.1), position=ORIGIN, orientation=TURNED)
    joints = []
    for kind, (_, slid, given) in KINDS.items():
        free = 0.0 if kind == "Gear" else turn  # whose wheels are in mesh where marks are along their line
        marks = [jnp.cos(a) * mark + jnp.sin(a) * jnp.cross(axis, mark) for a in (free, free + TWIST * size)]
        on_i = POINT + slid * TRAVEL * axis, *((mark, axis) if kind == "Universal" else (axis, marks[0]))
        there = POINT + size * SHIFT + RADIUS * mark * (kind == "Gear")
        on_j = rs.Placement(there, axis + jnp.tan(size) * jnp.cross(direction, axis), marks[1])
        own = rs.Placement(*(TURNED.T @ v for v in (on_i[0] - ORIGIN, *on_i[1:])))
        joints.append(getattr(rs, kind)(kind, "body", G, on_i=own, on_j=on_j, **given))
    return rx.Mechanism([body], joints)


@pytest.mark.parametrize("differentiated", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_every_joint_whatever_the_marks_of_parts_as_they_are(differentiated):
    """What is beyond first order is of second order in the tilt, for values and derivatives.

    Marks turned on both bodies count for nothing; one turned on one body counts where the joint holds the turn.
    """
    rng = np.random.default_rng(0)
    marks = np.cross(AXES, rng.normal(size=AXES.shape))
    marks /= np.linalg.norm(marks, axis=1, keepdims=True)
    angles, turns = rng.uniform(-np.pi, np.pi, size=(2, len(AXES)))
    directions = np.cos(angles)[:, None] * marks + np.sin(angles)[:, None] * np.cross(AXES, marks)

    def misfits(axis, mark, direction, turn, size):
        nominal = machine(axis, mark, direction)
        state = rx.State(nominal.reference, jnp.zeros(6))

        def of(size):
            return rx.misfit(nominal, machine(axis, mark, direction, size, turn), state)

        return jax.jvp(of, (size,), (1.0,)) if differentiated else (of(size), 0.0)

    over = jax.jit(jax.vmap(jax.vmap(misfits, (None, None, None, None, 0)), (0, 0, 0, 0, None)))
    values, slopes = map(np.asarray, over(AXES, marks, directions, turns, TILTS))
    labels = machine(AXES[0], marks[0], directions[0]).rows.labels
    for k, each in enumerate(zip(AXES, marks, directions, strict=True)):
        by_kind = expected(*each)
        wanted = np.array([next(by_kind[label.split(".")[0]]) for label in labels])
        beyond = np.abs(values[k] - TILTS[:, None] * wanted)
        assert np.all(beyond < 3 * TILTS[:, None] ** 2 + 1e-15)
        assert not differentiated or np.all(np.abs(slopes[k] - wanted) < 6 * TILTS[:, None] + 1e-13)


# Carriage on two rails --------------------------------------------------------------------------------


CORNERS = {"LF": (0.1, 0.1), "LB": (-0.1, 0.1), "RF": (0.1, -0.1), "RB": (-0.1, -0.1)}


def carriage(shift=0.0, yaw=0.0, **given):
    """A carriage along x on two rails, of which the left one is off in y and turned about z."""
    joints = []
    for name, (x, y) in CORNERS.items():
        off, turned = (shift, yaw) if y > 0 else (0.0, 0.0)
        on_i = rs.Placement((x, y, 0.0), axis=(1.0, 0.0, 0.0))
        on_j = rs.Placement((x, y + off + jnp.tan(turned) * x, 0.0), axis=(jnp.cos(turned), jnp.sin(turned), 0.0))
        joints.append(rs.Cylindrical(name, "carriage", G, on_i=on_i, on_j=on_j, **(given if name == "LF" else {})))
    return rx.Mechanism([rs.Body("carriage", 10.0, (0.1, 0.1, 0.1))], joints, gravity=(0, 0, -9.81))


SOFT = dict.fromkeys(CORNERS, (2e-8, 2e-5))  # m/N, rad/(N m)


def test_a_carriage_on_a_rail_that_is_off_and_turned():
    """The left front bearing is off by 50 um, and by 20 um more at 0.2 mrad: half of it at 50 N/um. By the turn of the
    carriage that the yaw asks for, all four yield alike."""
    nominal = carriage()
    state = rx.assemble(nominal)
    elastic, rows = rx.ElasticJoints(nominal, SOFT), [nominal.rows.labels.index(f"LF.radial_{k}") for k in (1, 2)]
    for yaw in (0.0, 1e-8, 1e-6, 2e-4):
        actual, off = carriage(50e-6, yaw), 50e-6 + 0.1 * yaw
        found = np.asarray(rx.misfit(nominal, actual, state))[rows]
        np.testing.assert_allclose(found, [-off, 0.0], rtol=1e-7, atol=1e-18)
        loads = rx.solve(nominal, state, closure=rx.AsBuilt(elastic, actual))
        np.testing.assert_allclose(loads["LF force y on carriage"], off / 2 / 2e-8, rtol=1e-7)
        np.testing.assert_allclose(loads["LF force z on carriage"], 10.0 * 9.81 / 4, rtol=1e-7)


@pytest.mark.slow
def test_a_motion_along_a_turned_rail():
    """The rail comes nearer by yaw times the travel."""
    nominal, yaw = carriage(), 2e-4
    state = rx.assemble(nominal, rates={"LF.travel": 0.5, "LF.angle": 0.0})
    closure = rx.AsBuilt(rx.ElasticJoints(nominal, SOFT), carriage(50e-6, yaw))
    motion = rx.simulate(nominal, state, 0.4, closure=closure, ts=[0.0, 0.4])
    off = 50e-6 + (0.1 + 0.5 * np.array([0.0, 0.4])) * yaw
    np.testing.assert_allclose(motion["LF force y on carriage"], off / 2 / 2e-8, rtol=1e-6)


def test_sizes_of_contacts_are_no_misfit():
    """A bearing whose size is known stands elsewhere among the arrays of the mechanism; the rows are the same."""
    nominal = carriage(bearing_length=0.05)
    found = rx.misfit(nominal, carriage(50e-6, 2e-4), rx.State(nominal.reference, jnp.zeros(6)))
    np.testing.assert_allclose(found[:4], [-70e-6, 0.0, -30e-6, 0.0], rtol=1e-7, atol=1e-18)
    np.testing.assert_allclose(found[8:12], [0.0, -2e-4, 0.0, -2e-4], rtol=1e-7, atol=1e-18)


def test_couplers_of_parts_as_they_are_read_their_own_marks():
    """A gear wheel on its shaft at another angle is off by that; marks turned on both bodies are not."""

    def shafts(by_i, by_j):
        bodies = [rs.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "ab"]
        marks = [(np.cos(a), np.sin(a), 0.0) for a in (by_i, by_j)]
        on_i, on_j = (rs.Placement((0, 0, 0), (0, 0, 1), mark) for mark in marks)
        joints = [rs.Revolute("A", "a", G, on_i=on_i, on_j=on_j), rs.Revolute("B", bodies[1], G, (1, 0, 0), (0, 0, 1))]
        return rx.Mechanism(bodies, joints, couplers=[rx.Coupler("belt", "A.angle", "B.angle", 1.0)])

    nominal = shafts(0.0, 0.0)
    state = rx.State(nominal.reference, jnp.zeros(12))
    for by, off in (((0.01, 0.0), 0.01), ((1.0, 1.0), 0.0)):
        found = rx.misfit(nominal, shafts(*by), state)
        np.testing.assert_allclose(
            found, off * (np.arange(11) == nominal.rows.labels.index("belt.coupling")), atol=1e-15
        )


# Marks that are not given -----------------------------------------------------------------------------


def tilted(axis, size, angle):
    """An axis tilted by `size` towards a direction square to it."""
    x, y, _ = axes_along("axis", axis, (0.3, 0.5, -0.4)).T
    return axis + np.tan(size) * (np.cos(angle) * x + np.sin(angle) * y)


def test_the_mark_of_axes_near_x_y_and_z_turns_by_no_tilt():
    """x of axes along y and z, y of those along x. A tilt turns it about the axis by second order only, so that slider
    and screw on a tilted axis have no twist."""
    for k, mark in enumerate(([0, 1, 0], [1, 0, 0], [1, 0, 0])):
        for axis in (np.eye(3)[k], -np.eye(3)[k]):
            axes = axes_along("axis", axis)
            np.testing.assert_array_equal(axes[:, 0], mark)
            for size in (1e-12, 1e-6, 1e-3, 0.1, 0.4):
                for angle in np.linspace(0.0, 2 * np.pi, 13):
                    turn = axes.T @ axes_along("axis", tilted(axis, size, angle))
                    assert abs(turn[1, 0] - turn[0, 1]) <= size**2 + 1e-16


def test_the_mark_jumps_on_one_cone_alone():
    rng, jumps = np.random.default_rng(1), []
    for axis in rng.normal(size=(2000, 3)):
        axis /= np.linalg.norm(axis)
        one, other = (axes_along("axis", each) for each in (axis, tilted(axis, 0.01, rng.uniform(0, 6.3))))
        if np.abs(other - one).max() > 0.1:
            jumps.append(np.degrees(np.arccos(abs(axis[0]))))
    assert len(jumps) > 3
    np.testing.assert_allclose(jumps, 27.8, atol=np.degrees(0.011))


# What cannot be compared ------------------------------------------------------------------------------


def machine_of(*joints, bodies="a", couplers=()):
    return rx.Mechanism([rs.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in bodies], joints, couplers=couplers)


def hinge(name, i="a", j=G, kind=rs.Revolute, axis_i=(0, 0, 1), axis_j=(0, 0, 1)):
    return kind(name, i, j, on_i=rs.Placement((0, 0, 0), axis_i), on_j=rs.Placement((0, 0, 0), axis_j))


def slot(normal):
    return rx.Mechanism(
        [rx.Body("a", 1.0, 1.0)], [rx.PinInSlot("S", "a", G, point_i=(0, 0), point_j=(0, 0), normal=normal)]
    )


A, B = hinge("A"), hinge("B")
BELT, CHAIN = (rx.Coupler(name, "A.angle", "B.angle", 1.0) for name in ("belt", "chain"))


@pytest.mark.parametrize(
    ("nominal", "actual", "words"),
    [
        (machine_of(A, B), machine_of(B, A), "Revolute 'B' between 'a' and 'ground' where .* Revolute 'A'"),
        (machine_of(A), machine_of(A, B), "Revolute 'B' between 'a' and 'ground' where `system` has nothing more"),
        (machine_of(A), machine_of(hinge("A", kind=rs.Cylindrical)), "has Cylindrical 'A' .* where"),
        (
            machine_of(A, hinge("B", "b"), bodies="ab"),
            machine_of(hinge("A", "b"), B, bodies="ab"),
            "Revolute 'A' between 'b' and 'ground' where",
        ),
        (
            machine_of(hinge("A", "a", "b"), bodies="ab"),
            machine_of(hinge("A", "b", "a"), bodies="ab"),
            "Revolute 'A' between 'b' and 'a' where",
        ),
        (
            machine_of(A, hinge("B", "b"), bodies="ab"),
            machine_of(A, hinge("B", "b"), bodies="ba"),
            "has body 'b' where `system` has body 'a'",
        ),
        (
            machine_of(A, B, couplers=[BELT]),
            machine_of(A, B, couplers=[CHAIN]),
            "moment-type row 'chain.coupling' where",
        ),
        (machine_of(A), machine_of(hinge("A", axis_i=(0, 0.1, -1))), "joint 'A' has one on body i"),
        (machine_of(A), machine_of(hinge("A", axis_j=(0, 0.1, -1))), "joint 'A' has one on body j"),
        (slot((0, 1)), slot((0.1, -1)), "joint 'S' has one on body j"),
    ],
)
def test_another_mechanism_is_refused_by_name(nominal, actual, words):
    as_built, nowhere = rx.AsBuilt(rx.MinimumNorm(), actual), rx.State(jnp.zeros(3), jnp.zeros(3))
    for ask in (lambda: rx.misfit(nominal, actual, nowhere), lambda: as_built.by_place(nominal)):
        with pytest.raises(rx.RedundaxError, match=f"`actual` must .*{words}"):
            ask()


def test_systems_of_other_rows_are_refused_by_name():
    def bead(row):
        rows = rx.Axis((row,), ("force",))
        return rx.System(lambda q, t, p: q[:1], mass=jnp.ones(2), rows=rows)

    with pytest.raises(rx.RedundaxError, match="has force-type row 'stop' where `system` has force-type row 'slot'"):
        rx.misfit(bead("slot"), bead("stop"), rx.State(jnp.zeros(2), jnp.zeros(2)))


def test_axes_of_the_other_sense_have_no_misfit_where_they_are_traced():
    nominal = machine_of(A)
    found = jax.jit(lambda actual: rx.misfit(nominal, actual, rx.State(nominal.reference, jnp.zeros(6))))
    assert np.isnan(found(machine_of(hinge("A", axis_j=(0, 0.1, -1))))[:2]).all()
    np.testing.assert_allclose(found(machine_of(hinge("A", axis_j=(0, 1e-3, 1)))), [0, 0, 0, 1e-3, 0], rtol=1e-6)
