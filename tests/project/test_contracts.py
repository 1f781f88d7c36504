"""What every public joint, load, contact, law of friction, closure and solver must do, found by looking for them.

A part that is added and forgotten has no sample, or breaks a law; the last tests plant such parts.
"""

import functools

import contracts
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._equations._kinematics import along_motion, slip_motion
from redundax._models._choice import _WORDS
from redundax._models._kinds import KINDS
from redundax._models._stress import AXES
from redundax._tools._module import replace_fields
from redundax.plot._draw import _symbols
from redundax.plot._draw._scene import scene

rs, ZERO = rx.spatial, jnp.zeros(())
SAMPLES = {
    rx.AbstractJoint: contracts.IN_SPACE | contracts.IN_THE_PLANE,
    rx.AbstractLoad: contracts.LOADS_IN_SPACE | contracts.LOADS_IN_THE_PLANE,
    rx.AbstractFrictionModel: contracts.LAWS,
    rs.AbstractContact: contracts.CONTACTS,
    rx.AbstractClosure: contracts.CLOSURES,
    rx.AbstractSolver: contracts.SOLVERS,
}
MAKE = {"space": contracts.in_space, "the plane": contracts.in_the_plane}
each_frame = pytest.mark.parametrize("frame", MAKE)


@pytest.mark.parametrize("kind", SAMPLES, ids=lambda kind: kind.__name__)
def test_every_public_part_has_a_sample(kind):
    assert contracts.public(kind)
    assert contracts.forgotten(kind, SAMPLES[kind]) == []


# ------------------------------------------------------------------------------------------ joints


@functools.cache
def known(frame, u=1.0):
    """All joints of a frame, a state, and what they and their friction have there."""
    mechanism = MAKE[frame](u)
    return mechanism, *answers(mechanism, contracts.somewhere(mechanism, u), u)


def answers(mechanism, state, u):
    scale = np.where(mechanism.rows.angular, u, 1.0)  # multipliers are forces and moments
    loads = jnp.asarray(scale * np.random.default_rng(4).normal(size=scale.size))
    rate = jnp.asarray(np.where(mechanism.slips.angular, 0.7, 0.7 * u))
    return state, loads, {name: np.asarray(x) for name, x in _values(mechanism, state, loads, rate).items()}


@jax.jit
def _values(mechanism, state, loads, rate):
    groups, at, kinds = mechanism.friction, 0, ("friction", "twice", "sum", "beside")
    found = {name: [] for name in (*kinds, "bound", "slips", "alone")}
    beside = jnp.flip(loads)
    for group in groups:
        own = slice(at, at := at + len(group.slips))
        one, other = loads[group.rows], beside[group.rows]
        force = functools.partial(group.force, rate=rate[own], sense=jnp.ones_like(rate[own]), memory=None, state=state)
        forces = jax.vmap(lambda rho, force=force: force(rho))(jnp.stack([one, 2 * one, one + other, other]))
        for name, part in zip(kinds, forces, strict=True):
            found[name].append(part)
        units = jnp.eye(one.size).reshape(one.size, *one.shape)
        alone = jax.vmap(lambda rho, force=force: jnp.sum(jnp.abs(force(rho))))(units)
        found["alone"].append(jnp.zeros_like(loads).at[group.rows].set(alone.reshape(one.shape)))
        found["slips"].append(group.slip(state.q, state.t))
        found["bound"].append(group.largest_change(other, rate[own], None, state))
    return {
        "rows": mechanism.constraint(state.q, state.t),
        "velocities": mechanism.velocity_constraint(state.q, state.qd, state.t),
        "jacobian": mechanism.jacobian(state.q, state.t),
        "coordinates": mechanism.joint_coordinates.positions(state),
        "load": mechanism.load(state),
        "alone": sum(found.pop("alone")),
        **{name: jnp.concatenate(parts) for name, parts in found.items()},
    }


@each_frame
def test_names_of_rows_coordinates_and_slips(frame):
    mechanism, _, _, found = known(frame)
    for axis, count in ((mechanism.rows, found["rows"].size), (mechanism.slips, found["friction"].size)):
        assert len(set(axis.labels)) == len(axis) == count
    assert len(mechanism.names.joint_coordinates) == found["coordinates"].size
    assert all(np.isfinite(x).all() for x in found.values())
    assert set(mechanism.rows.kinds) == {"force", "moment"}


def test_rows_of_joints_of_files_have_words_and_axes():
    names = {label.rpartition(".")[2] for label in known("space")[0].rows.labels}
    assert set(_WORDS) == set(AXES) == {row for kind in KINDS.values() for row in kind.rows} <= names


@each_frame
def test_derivatives_along_a_motion(frame):
    """Of residuals and slips, from differences along the velocity; the Jacobian is that of the residual. Rows of
    velocity are their rate themselves."""
    mechanism, state, _, found = known(frame)
    h = 1e-4

    def at(s):
        there = answers(mechanism, rx.State(mechanism.retract(state.q, s * state.qd), state.qd, state.t), 1.0)[2]
        return there["rows"], there["slips"], there["velocities"]

    before, now, after = (at(s) for s in (-h, 0.0, h))
    motion = along_motion(mechanism, state)
    rate, directions = map(np.asarray, slip_motion(mechanism, state))
    slope, bend = (after[0] - before[0]) / (2 * h), (after[0] - 2 * now[0] + before[0]) / h**2
    slope, bend = slope + now[2], bend + (after[2] - before[2]) / (2 * h)
    size = 1 + np.abs(bend)
    np.testing.assert_allclose(motion.rate / size, slope / size, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["jacobian"] @ state.qd / size, slope / size, rtol=0, atol=1e-6)
    np.testing.assert_allclose(-motion.gamma / size, bend / size, rtol=0, atol=1e-5)
    spins = [k for k, name in enumerate(mechanism.slips.labels) if name.startswith("Spherical.")]  # no coordinates
    moves = [k for k in range(len(rate)) if k not in spins]
    np.testing.assert_allclose(rate[moves], ((after[1] - before[1]) / (2 * h))[moves], rtol=0, atol=1e-6)
    np.testing.assert_allclose(directions.T @ state.qd, rate, rtol=0, atol=1e-12)


def broken_units(mechanism, small, large, u):
    """Rows, coordinates and friction of another kind than they say: lengths are u times as large, angles as before."""
    out = []
    axes = {"rows": mechanism.rows, "coordinates": mechanism.names.joint_coordinates, "slips": mechanism.slips}
    for name, axis in axes.items():
        scale = np.where(axis.angular, 1.0, u)
        out += _unequal(axis, scale * small[name], large[name])
    scale = np.where(mechanism.slips.angular, u, 1.0)
    return out + _unequal(mechanism.slips, scale * small["friction"], large["friction"])


def _unequal(axis, one, other):
    return [label for label, a, b in zip(axis.labels, one, other, strict=True) if abs(a - b) > 1e-9 * (abs(a) + abs(b))]


@each_frame
def test_rows_coordinates_and_friction_have_the_units_of_their_kinds(frame):
    """In millimetres residuals of force-type rows and travels are 1000 times as large, and so are friction moments."""
    mechanism, _, _, small = known(frame)
    _, _, _, large = known(frame, 1000.0)
    assert broken_units(mechanism, small, large, 1000.0) == []
    scale = np.where(mechanism.coordinates.angular, 1000.0, 1.0)
    np.testing.assert_allclose(large["load"], scale * small["load"], rtol=1e-9)


def broken_claims(mechanism, found):
    """Slips whose bound is exceeded, or whose convexity is claimed and not there."""
    convex = np.concatenate([np.full(len(group.slips), group.has_convex_limits) for group in mechanism.friction])
    size = {name: np.abs(found[name]) for name in ("friction", "twice", "sum", "beside")}
    change = np.abs(found["sum"] - found["friction"]) > found["bound"] * (1 + 1e-9)
    bent = size["sum"] > (size["friction"] + size["beside"]) * (1 + 1e-9)
    scaled = np.abs(size["twice"] - 2 * size["friction"]) > 1e-9 * size["twice"]
    return [
        label for label, wrong in zip(mechanism.slips.labels, change | convex & (bent | scaled), strict=True) if wrong
    ]


def deaf_rows(mechanism, found):
    """Rows of joints that rub whose load alone rubs nowhere."""
    rubs = np.zeros(len(mechanism.rows), bool)
    rubs[np.concatenate([np.ravel(group.rows) for group in mechanism.friction])] = True
    return [mechanism.rows.labels[k] for k in np.flatnonzero(rubs & (found["alone"] == 0))]


@each_frame
def test_each_load_of_a_joint_that_rubs_presses(frame):
    mechanism, _, _, found = known(frame)
    assert deaf_rows(mechanism, found) == []


def named_directions(joint, k, axes):
    """Directions of forces by the names of rows, of the k-th of joints on a body with these axes."""
    if len(axes) == 2:
        normal = {"perpendicular": axes @ np.asarray(joint.normal)[k]} if hasattr(joint, "normal") else {}
        return {"x": np.eye(2)[0], "y": np.eye(2)[1]} | normal
    own = joint.axes_on("j")
    names = "radial_1", "radial_2", "axial"
    return {} if own is None else dict(zip(names, (axes @ np.asarray(own)[k]).T, strict=True))


def misnamed_rows(mechanism, state, found):
    """Rows of forces that are not along the direction of their name."""
    axes, out = np.asarray(mechanism.poses(state.q).axes[1]), []
    for stack, names in zip(mechanism.joints, mechanism.names.joints, strict=True):
        for k, name in enumerate(names):
            for word, along in named_directions(stack.element, k, axes).items():
                if (label := f"{name}.{word}") in mechanism.rows.labels:
                    force = found["jacobian"][mechanism.rows.labels.index(label), : len(axes)]  # by those of body i
                    if min(np.abs(force - along).max(), np.abs(force + along).max()) > 1e-9:
                        out.append(label)
    return out


@each_frame
def test_forces_are_along_the_directions_that_their_rows_name(frame):
    """As `joint_wrench` promises and pictures and contacts read them; a row along something else has another name."""
    mechanism, state, _, found = known(frame)
    assert misnamed_rows(mechanism, state, found) == []


@each_frame
def test_bounds_and_convexity_of_friction(frame):
    """Coulomb friction is a seminorm of the loads where a joint says so, and changes by its bound at most."""
    mechanism, _, _, found = known(frame)
    assert np.all(np.isfinite(found["bound"]))
    assert broken_claims(mechanism, found) == []


def broken_axes(mechanism):
    """Joints that do not constrain the same with their axes turned as `free_axes` allows."""
    turns = {"none": np.eye(3), "across": turn_about_z(), "all": ANY_TURN}
    stacks = []
    for stack in mechanism.joints:
        joint = stack.element
        axes = {name: value @ turns[joint.free_axes] for name, value in vars(joint).items() if name[:-1] == "axes_"}
        stacks.append(replace_fields(stack, element=replace_fields(joint, **axes)))
    state = rx.State(mechanism.reference, jnp.zeros(12), 0.0)
    both = [
        answers(each, state, 1.0)[2]["jacobian"] for each in (mechanism, replace_fields(mechanism, joints=(*stacks,)))
    ]
    rows = {name: [] for name in (label.partition(".")[0] for label in mechanism.rows.labels)}
    for k, label in enumerate(mechanism.rows.labels):
        rows[label.partition(".")[0]].append(k)
    ranks = {
        name: np.linalg.matrix_rank(np.concatenate([each[own] for each in both]), tol=1e-9)
        for name, own in rows.items()
    }
    return [name for name, own in rows.items() if ranks[name] != len(own)]


def turn_about_z():
    return np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])


ANY_TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def test_turns_of_axes_that_change_no_constraint():
    assert broken_axes(known("space")[0]) == []


def unknown_pictures(mechanism, state):
    """Joints that are drawn as none that the library knows."""
    joints = scene(mechanism, state).joints
    return [joint.name for joint in joints if _symbols.symbol(joint) is _symbols._unknown]


@each_frame
def test_every_joint_has_a_symbol(frame):
    mechanism, state, _, _ = known(frame)
    assert set(unknown_pictures(mechanism, state)) <= {"Free"}  # which holds nothing


# --------------------------------------------------------------------------------------- the rest


@pytest.mark.parametrize("law", contracts.LAWS.values(), ids=lambda law: type(law).__name__)
def test_laws_of_friction_do_as_they_say(law):
    """Slopes within their bound; proportional where they say so; against the slip; the same about an axis."""
    loads, radius = jnp.asarray([0.0, 1.0, 2.0, 7.0]), jnp.asarray(0.3)
    size = law.memory_size()
    for rate, share in ((0.2, 0.5), (-0.9, -0.8), (3.0, 0.1)):
        w, memory = jnp.asarray(rate), None if size is None else share * size
        at = functools.partial(law.force, rate=w, memory=memory)
        force = np.array([at(N, sense=jnp.sign(w)) for N in loads])
        slopes = np.diff(force) / np.diff(loads)
        assert np.all(np.abs(slopes) <= law.slope_bound(w, memory) * (1 + 1e-12))
        assert law.depends_on_load == bool(np.any(slopes != 0))
        assert law.has_sense == bool(np.any(force != [at(N, sense=-jnp.sign(w)) for N in loads]))
        if law.is_proportional:
            np.testing.assert_allclose(slopes, slopes[0], rtol=1e-12)
        if size is None:
            assert law.memory_rate(w, None) is None
            assert np.all(force * rate <= 0)
        else:
            full = jnp.sign(w) * size * 1.0001
            assert jnp.sign(full) * law.memory_rate(1e3 * w, full) <= 0 or law.memory_rate(w, full) * w <= 0
        about = law.about(radius)
        np.testing.assert_allclose(
            [about.force(N, w / radius, jnp.sign(w), memory) for N in loads], radius * force, rtol=1e-12
        )
        np.testing.assert_allclose(about.slope_bound(w / radius, memory), radius * law.slope_bound(w, memory))


@pytest.mark.parametrize("contact", contracts.CONTACTS.values(), ids=lambda contact: type(contact).__name__)
def test_contacts_do_as_they_say(contact):
    size, random = rs.ContactSize(jnp.asarray(0.05), jnp.asarray(0.7), jnp.asarray(0.03)), np.random.default_rng(0)
    for one, other in random.normal(size=(20, 2, 6)):
        x, y, both = (
            contact.normal_load(rs.ContactLoad(v[:2], v[2], v[3:5], v[5]), size)
            for v in map(jnp.asarray, (one, other, one + other))
        )
        change = contact.largest_change(rs.ContactLoad(other[:2], jnp.asarray(other[2]), other[3:5], other[5]), size)
        assert abs(both - x) <= change * (1 + 1e-12)
        if contact.is_seminorm:
            assert 0 <= both <= (x + y) * (1 + 1e-12)


INTERNAL = {rx.SpringDamper, rx.TorsionSpring, rs.SpringDamper, rs.TorsionSpring, rs.Bushing}


@each_frame
def test_loads_between_bodies_press_one_as_they_press_the_other(frame):
    """Force, and moment about one point, of both ends: zero together."""
    mechanism, state, _, _ = known(frame)
    bodies = mechanism.frame.motions(mechanism.body, state)
    for stack in mechanism.loads:
        ends = stack.over(lambda load, i, j: load.wrenches(i, j, ZERO), bodies)
        force = sum(np.asarray(end.force[0], float) for end in ends)
        if type(stack.element) not in INTERNAL:
            continue
        arms = [np.asarray(bodies.pose.r[int(at[0])]) for at in (stack.i, stack.j)]
        ends = [(np.asarray(end.moment[0]), arm, np.asarray(end.force[0])) for end, arm in zip(ends, arms, strict=True)]
        moment = sum(
            about + (np.cross(arm, f) if arm.size == 3 else arm[0] * f[1] - arm[1] * f[0]) for about, arm, f in ends
        )
        np.testing.assert_allclose(force, 0, atol=1e-12)
        np.testing.assert_allclose(moment, 0, atol=1e-12)


@functools.cache
def press():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    return mechanism, mechanism.state(phi=0.8, rate=1.0)


@pytest.mark.parametrize("kind", contracts.CLOSURES, ids=lambda kind: kind.__name__)
def test_closures_give_compliance_and_misfit(kind):
    """Symmetric and nowhere negative, positive on the self-stress; constant if they say so; the same by place, and
    where matrices are sparse."""
    mechanism, state = press()
    closure, there = contracts.CLOSURES[kind](mechanism), mechanism.state(phi=2.0, rate=1.0)
    W, d = map(np.asarray, closure.compliance(mechanism, state))
    entries, misfit = map(np.asarray, closure.by_joint(mechanism.sparse(), state))
    np.testing.assert_allclose(entries[:, 0], np.diag(W), rtol=1e-14)
    np.testing.assert_array_equal(misfit, d)
    assert W.shape == (12, 12) and d.shape in ((), (12,))
    np.testing.assert_allclose(W, W.T, rtol=0, atol=1e-12 * np.abs(W).max())
    assert np.linalg.eigvalsh(W).min() >= -1e-12 * np.abs(W).max()
    N = np.linalg.svd(np.asarray(mechanism.jacobian(state.q, state.t)))[0][:, -1:]  # of one redundant row
    assert np.linalg.eigvalsh(N.T @ W @ N).min() > 1e-12 * np.abs(W).max()
    other = closure.compliance(mechanism, there)
    same = np.array_equal(other[0], W) and np.array_equal(other[1], d)
    assert same or not closure.is_constant
    for one, again in zip((W, d), closure.by_place(mechanism).compliance(mechanism.anonymous, state), strict=True):
        np.testing.assert_array_equal(one, again)


@pytest.mark.parametrize("kind", contracts.SOLVERS, ids=lambda kind: kind.__name__)
def test_solvers_meet_the_equations(kind):
    """M qdd + Phi_q^T lam = Q + E tau with tau of the law, and the acceleration of the constraints."""
    mechanism, state = press()
    found = rx.solve(mechanism, state, solver=contracts.SOLVERS[kind])
    assert found.result == rx.RESULTS.successful
    (group,), lam = mechanism.friction, jnp.asarray(found.multipliers)
    _, E = slip_motion(mechanism, state)
    rate = E.T @ state.qd
    tau = group.force(lam[group.rows], rate, jnp.sign(rate), None, state)
    np.testing.assert_allclose(found.friction, tau, rtol=1e-11)
    lhs = mechanism.mass(state.q, state.t) @ found.acceleration + mechanism.jacobian(state.q, state.t).T @ lam
    np.testing.assert_allclose(lhs, mechanism.load(state) + E @ tau, atol=1e-10 * np.abs(lam).max())


# -------------------------------------------------------------------------- forgotten parts are found


class Hook(rs.AbstractPlacedJoint):
    """A ball in a slot that holds its turn: nothing but names of what it locks."""

    row_kinds = (("radial_1", "force"), ("radial_2", "force"), ("twist", "moment"))
    coordinate_kinds = (("travel", "linear"),)
    free_axes = "all"  # which is not so
    __init__ = rs.AbstractPlacedJoint.__init__


class Rule(rs.AbstractPlacedJoint):
    """An offset that is called a moment, in a row of a name that nobody knows, beside one that has a known name."""

    row_kinds = (("axial", "force"), ("askew", "moment"))
    __init__ = rs.AbstractPlacedJoint.__init__

    def residual(self, i, j, t):
        return self.relative(i, j).offset[::-2]


class Brake(rs.AbstractFrictionalJoint):
    """A hinge that claims convexity of a product, and friction of the wrong unit."""

    row_kinds, coordinate_kinds = rs.Revolute.row_kinds, rs.Revolute.coordinate_kinds
    slip_kind = "linear"
    friction: rx.AbstractFrictionModel
    contact: rs.AbstractContact

    def __init__(self, *place, **options):
        self.make(*place, **options)

    def normal_load(self, multipliers, ends=None):
        return jnp.abs(multipliers[0] * multipliers[2])

    largest_change = normal_load


class BallOnCircle(rs.AbstractPlacedJoint):
    """A ball on a circle about the axis of body j: it keeps all laws but that its force turns with the ball, off x."""

    row_kinds = (("radial_1", "force"), ("axial", "force"))
    radius: jax.Array

    def __init__(self, name, i, j, point, axis, mark, *, radius):
        at = rs.Placement(point, axis, mark)
        self.place_both(name, i, j, (at, rs.Placement(at.point - radius * at.axes[:, 0], axis, mark)), (None, None))
        self.radius = jnp.asarray(radius)

    def residual(self, i, j, t):
        x, y, z = self.relative(i, j).offset
        return jnp.stack([jnp.hypot(x, y) - self.radius, z])


def test_forgotten_parts_are_found():
    class Room:
        """A namespace with one more joint."""

    Room.BallOnCircle = BallOnCircle
    assert contracts.forgotten(rx.AbstractJoint, SAMPLES[rx.AbstractJoint], Room) == ["Room.BallOnCircle"]
    assert not contracts.is_pair(BallOnCircle) and contracts.is_pair(Hook)


def test_parts_that_break_a_law_are_found():
    def brake(a, b, u):
        at = rs.Placement(u * contracts.HERE)
        return Brake("Brake", a, b, [at, at], friction=contracts.COULOMB)

    def circle(a, b, u):
        return BallOnCircle("Circle", a, b, u * contracts.HERE, *contracts.SQUARE, radius=0.2 * u)

    samples = {Hook: contracts.pair(Hook), Rule: contracts.pair(Rule), Brake: brake, BallOnCircle: circle}
    small, large = (contracts.in_space(u, samples) for u in (1.0, 10.0))
    (state, _, here), (_, _, there) = (
        answers(each, contracts.somewhere(each, u), u) for each, u in ((small, 1.0), (large, 10.0))
    )
    assert broken_axes(small) == ["Hook"]
    assert broken_units(small, here, there, 10.0) == ["Rule.askew", "Brake"]
    assert broken_claims(small, here) == ["Brake"]
    assert misnamed_rows(small, state, here) == ["Circle.radial_1"]
    assert unknown_pictures(small, state) == ["Rule"]
