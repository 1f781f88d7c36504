"""Compliance and misfit of joints in space: laws, complementary energy in NumPy, stiff bushings and closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import redundax as rx

rs, G = rx.spatial, "ground"
PINS = np.array([[0.0, 0.0, 0.0], [0.2, 0.3, 0.0], [0.9, 0.45, 0.0], [0.8, 0.0, 0.0]])
AXIS, MARK = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
PAIRS = {"A": ("crank", G), "B": ("coupler", "crank"), "C": ("coupler", "rocker"), "D": ("rocker", G)}
LEFT = Rotation.from_rotvec([0.4, -0.9, 0.7]).as_matrix()
FRAMES = ("crank", "coupler", "rocker", G)
SAME, HERE = np.eye(3), np.zeros(3)


def figures(k):
    """Unequal, coupled compliance (6, 6), a misfit of a tenth of a millimetre and a milliradian, and an arm."""
    rng, size = np.random.default_rng(k), np.array([1e-4] * 3 + [1e-3] * 3)
    root = rng.normal(size=(6, 6)) * size[:, None]
    return root @ root.T, size * rng.normal(size=6), 0.05 * rng.normal(size=3)


def bars(R=SAME, p=HERE):
    out = {G: G}
    for k, name in enumerate(("crank", "coupler", "rocker")):
        start, way = PINS[k], PINS[k + 1] - PINS[k]
        length = np.linalg.norm(way)
        axes = np.stack([way / length, np.cross(AXIS, way / length), AXIS], axis=1)
        inertia = (1e-4, length**2 / 12, length**2 / 12)
        out[name] = rs.Body(
            name, 1.0, inertia, centre=(length / 2, 0, 0.02), position=R @ start + p, orientation=R @ axes
        )
    return out


def local(body, point):
    """A global point at the reference pose in the local frame of a body, and what turns directions so."""
    if body == G:
        return point, np.eye(3)
    w, *v = np.asarray(body.orientation)
    turn = Rotation.from_quat([*v, w]).as_matrix().T
    return turn @ (point - np.asarray(body.position)), turn


def four_bar(R=SAME, p=HERE, swapped=(), moved=()):
    """A four-bar on elastic hinges, with its state and closure; given otherwise where the names of hinges say so."""
    bodies, joints, seats = bars(R, p), [], []
    for k, (name, pair) in enumerate(PAIRS.items()):
        i, j = (bodies[b] for b in (reversed(pair) if name in swapped else pair))
        point, axis, mark = R @ PINS[k] + p, R @ AXIS, R @ MARK
        joints.append(rs.Revolute(name, i, j, point=point, axis=axis, mark=mark))
        C, misfit, arm = figures(k)
        if name in moved:
            other = np.array([0.2, -0.1, 0.3])
            shift = np.eye(6)  # displacement at the other point: turn x arm more
            shift[:3, 3:] = -np.cross(other, SAME).T
            C, misfit, arm = shift @ C @ shift.T, shift @ misfit, arm + other
        frame = FRAMES[k]
        about, _ = local(bodies[frame], point + R @ arm)
        misfit = -misfit if name in swapped else misfit
        given = {"coupling": C[3:, :3], "misfit": misfit, "frame": frame, "point": about}
        seats.append(rs.JointCompliance(name, C[:3, :3], C[3:, 3:], **given))
    mechanism = rx.Mechanism([bodies[b] for b in FRAMES[:3]], joints, gravity=R @ [1.0, -9.81, 2.0])
    state = rx.assemble(mechanism, rates={"D.angle": -1.5 if "D" in swapped else 1.5})
    return mechanism, state, rx.ElasticJoints(mechanism, seats)


@pytest.fixture(scope="module")
def plain():
    mechanism, state, closure = four_bar()
    return mechanism, state, closure, rx.solve(mechanism, state, closure=closure)


@pytest.mark.slow
def test_it_is_the_least_complementary_energy_of_seats(plain):
    """Wrenches of the hinges on bodies j that balance the inertia, w^T C w / 2 - w^T v0 least, in NumPy."""
    mechanism, state, _, solution = plain
    bodies, order = bars(), list(FRAMES[:3])
    x = np.asarray(state.q[:9]).reshape(3, 3)
    on_bodies, energies = np.zeros((18, 20)), []
    for k, (i, j) in enumerate(PAIRS.values()):
        held = np.delete(np.eye(6), 5, axis=1)  # about the pin nothing
        for body, sign in ((i, -1), (j, 1)):
            if body == G:
                continue
            b, turn = order.index(body), local(bodies[body], PINS[k])[1]
            arm = PINS[k] - x[b]
            force, moment = held[:3], held[3:] + np.cross(arm, held[:3], axis=0)
            on_bodies[3 * b : 3 * b + 3, 5 * k : 5 * k + 5] = sign * force
            on_bodies[9 + 3 * b : 12 + 3 * b, 5 * k : 5 * k + 5] = sign * turn @ moment
        C, misfit, arm = figures(k)
        seat = held.copy()  # about the seat's point of reference
        seat[3:] -= np.cross(arm, held[:3], axis=0)
        energies.append((seat.T @ C @ seat, seat.T @ misfit))
    inertia = mechanism.mass(state.q, state.t) @ solution.acceleration - mechanism.load(state)
    one = np.linalg.lstsq(on_bodies, inertia, rcond=None)[0]
    free = np.linalg.svd(on_bodies)[2][17:].T
    W, d = np.zeros((20, 20)), np.concatenate([misfit for _, misfit in energies])
    for k, (block, _) in enumerate(energies):
        W[5 * k : 5 * k + 5, 5 * k : 5 * k + 5] = block
    wrenches = one + free @ np.linalg.solve(free.T @ W @ free, free.T @ (d - W @ one))
    size = np.max(np.abs(wrenches))
    for k, (name, (i, _)) in enumerate(PAIRS.items()):
        found = [solution[f"{name} {part} {axis} on {i}"] for part in ("force", "moment") for axis in "xyz"]
        np.testing.assert_allclose(np.asarray(found)[:5], -wrenches[5 * k : 5 * k + 5], atol=1e-9 * size)


@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (3.0, -2.0, 5.0)], ids=("turned", "turned and carried off"))
def test_the_whole_model_may_stand_anywhere(plain, p):
    """Rows are in the axes of the joints, so all multipliers stay."""
    mechanism, state, closure = four_bar(LEFT, np.array(p))
    there = rx.solve(mechanism, state, closure=closure)
    size = np.max(np.abs(plain[3].multipliers))
    np.testing.assert_allclose(there.multipliers, plain[3].multipliers, atol=1e-10 * size)


def test_bodies_may_change_places_and_reference_points_move(plain):
    mechanism, state, closure = four_bar(swapped="BD", moved="ABC")
    there, here = rx.solve(mechanism, state, closure=closure), plain[3]
    pairs = [("A", "crank", "crank", 1), ("B", "coupler", "crank", -1), ("D", "rocker", "rocker", 1)]
    size = np.max(np.abs(here.multipliers))
    for name, i, other, sign in pairs:
        for part in (f"{what} {axis}" for what in ("force", "moment") for axis in "xyz"):
            one, two = here[f"{name} {part} on {i}"], there[f"{name} {part} on {other}"]
            np.testing.assert_allclose(two, sign * one, atol=1e-10 * size)


@pytest.mark.parametrize("units", [rx.units.Units(length=1000.0, mass=0.001), rx.units.Units(angle=57.29577951308232)])
def test_other_units_change_nothing(plain, units):
    mechanism, state, closure, here = plain
    there = rx.solve(
        rx.units.in_units(mechanism, units),
        rx.units.state_in_units(state, mechanism, units),
        closure=rx.units.closure_in_units(closure),
    )
    back = rx.units.solution_from_units(there, mechanism, units)
    np.testing.assert_allclose(back.multipliers, here.multipliers, atol=1e-10 * np.max(np.abs(here.multipliers)))


@pytest.mark.slow
def test_figures_may_be_in_other_units(plain):
    mechanism, state, closure, _ = plain
    units, grown = rx.units.Units(length=1000.0, mass=0.001), np.array([1e3] * 3 + [1.0] * 3)
    seats = []
    for k, (name, frame) in enumerate(zip(PAIRS, FRAMES, strict=True)):
        C, misfit, arm = figures(k)
        C, about = C * np.outer(grown, grown) / 1e3, local(bars()[frame], PINS[k] + arm)[0]  # 1 J is 1e3 N mm
        given = {"coupling": C[3:, :3], "misfit": misfit * grown, "frame": frame, "point": 1e3 * about}
        seats.append(rs.JointCompliance(name, C[:3, :3], C[3:, 3:], **given))
    other = rx.ElasticJoints(mechanism, seats, units)
    for one, two in zip(*(each.compliance(mechanism, state) for each in (closure, other)), strict=True):
        np.testing.assert_allclose(two, one, atol=1e-12 * np.max(np.abs(one)))


def test_a_rod_gives_way_along_itself_alone():
    """It has no axes: its compliance is along those of the body, n^T C n with n seen from there."""
    C = figures(1)[0][:3, :3]
    body = rs.Body("plate", 2.0, (0.1, 0.1, 0.2), orientation=LEFT, position=(0.2, 0.1, -0.3))
    ends = np.array([[0.5, 0.2, 0.1], [0.7, -0.1, 1.2]])
    mechanism = rx.Mechanism([body], [rs.Distance("rod", body, G, *ends)])
    state = rx.State(mechanism.reference, jnp.zeros(6))
    closure = rx.ElasticJoints(mechanism, [rs.JointCompliance("rod", C, misfit=(1e-4, 2e-4, 3e-4, 0, 0, 0))])
    W, d = closure.compliance(mechanism, state)
    n = LEFT.T @ (ends[0] - ends[1]) / np.linalg.norm(ends[0] - ends[1])
    np.testing.assert_allclose(W, [[n @ C @ n]], rtol=1e-12)
    np.testing.assert_allclose(d, [n @ [1e-4, 2e-4, 3e-4]], rtol=1e-12)


HEIGHTS = {"bottom": 0.2, "mid": 1.0, "top": 1.9}


def hinges(body):
    return [rs.Revolute(name, body, G, point=(0, 0, z)) for name, z in HEIGHTS.items()]


def door():
    body = rs.Body("door", 20.0, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
    return rx.Mechanism([body], hinges(body), gravity=(0.0, -3.0, -9.81))


@pytest.mark.slow
def test_stiff_bushings_come_near_as_they_are_stiffer():
    """In place of all three hinges, with a motor that holds the door: loads differ in proportion to the compliance."""
    body = rs.Body("door", 20.0, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
    motor = rs.AngleDriver("motor", body, G, point=(0, 0, 0), angle=0.0)
    give = {"bottom": (3e-4, 2e-3), "mid": (1e-4, 1e-3), "top": (2e-4, 3e-3)}
    mechanism = rx.Mechanism([body], [*hinges(body), motor], gravity=(0.0, -3.0, -9.81))
    solution = rx.solve(mechanism, rx.assemble(mechanism), closure=rx.ElasticJoints(mechanism, give))
    rows = [f"{name}.{row}" for name in give for row in ("radial_1", "radial_2", "axial", "bend_1", "bend_2")]
    exact = np.array([solution[row] for row in rows])

    def soft(share):
        stiff = {
            name: {"translation": 1 / (c * share), "rotation": jnp.array([1.0, 1.0, 0.0]) / (r * share)}
            for name, (c, r) in give.items()
        }
        loads = [rs.Bushing(body, G, point=(0, 0, HEIGHTS[name]), **given) for name, given in stiff.items()]
        return rx.Mechanism([body], [motor], loads=loads, gravity=(0.0, -3.0, -9.81))

    def unbalance(unknown, share):
        mechanism = soft(share)
        state = rx.State(mechanism.retract(mechanism.reference, unknown[:6]), jnp.zeros(6))
        force = mechanism.load(state) - mechanism.jacobian(state.q, state.t).T @ unknown[6:]
        return jnp.append(force, mechanism.constraint(state.q, state.t))

    @jax.jit
    def step(unknown, share):
        slope = jax.jacfwd(unbalance)(unknown, share)
        return unknown - jnp.linalg.solve(slope, unbalance(unknown, share))

    def loads(share):
        unknown = jnp.zeros(7)
        for _ in range(6):
            unknown = step(unknown, share)
        assert np.max(np.abs(unbalance(unknown, share))) < 1e-8
        shift, turn = np.split(np.array(unknown[:6]), 2)
        turn = Rotation.from_quat([*turn / 2, 1.0])
        origin = np.array(body.centre) + shift - turn.apply(np.array(body.centre))
        offsets = {name: origin + turn.apply([0, 0, z]) - [0, 0, z] for name, z in HEIGHTS.items()}
        each = [[*offsets[name] / c, *turn.as_rotvec()[:2] / r] for name, (c, r) in give.items()]
        return np.concatenate(each) / share

    errors = [np.max(np.abs(loads(share) - exact)) / np.max(np.abs(exact)) for share in (1e-2, 1e-3)]
    assert errors[0] < 1e-2
    assert 0.05 * errors[0] < errors[1] < 0.15 * errors[0]


def test_a_hot_door_pushes_on_its_hinges_as_springs_side_by_side():
    """Axial forces alpha dT (z - mean z) / c; none if the wall grows with it, and the misfit is the same figure."""
    mechanism, c, growth = door(), 2e-8, 12e-6 * 40.0
    state, names = rx.assemble(mechanism), list(HEIGHTS)
    closure = rx.ElasticJoints(mechanism, dict.fromkeys(names, (c, 1e-6)))

    def axial(warmer):
        actual = rx.heated(mechanism, warmer, 12e-6)
        solution = rx.solve(mechanism, state, closure=rx.AsBuilt(closure, actual))
        weight = rx.solve(mechanism, state, closure=rx.AsBuilt(closure, mechanism))
        return np.array(solution.multipliers - weight.multipliers)

    z = np.array(list(HEIGHTS.values()))
    expected = growth * (z - z.mean()) / c
    found = axial({"door": 40.0})
    rows = [mechanism.rows.labels.index(f"{name}.axial") for name in names]
    np.testing.assert_allclose(found[rows], expected, rtol=1e-8)
    np.testing.assert_allclose(np.delete(found, rows), 0.0, atol=1e-8 * np.max(expected))
    assert np.max(np.abs(axial({"door": 40.0, G: 40.0}))) < 1e-7 * np.max(expected)


def test_a_hinge_set_beside_its_place_and_askew_is_a_misfit():
    """The side on the wall moved and turned, as geometry and as a figure in the axes of the joint."""
    body = rs.Body("door", 20.0, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0), orientation=LEFT, position=(0.3, 0.1, 0.2))
    point, axis, mark = np.array([0.1, 0.2, 1.5]), np.array([0.2, -0.3, 0.9]), np.array([1.0, 0.4, 0.0])
    shift, turn = np.array([0.3, -0.2, 0.5]), np.array([0.7, 0.4, 0.0])
    hinge = rs.Revolute("top", body, G, point=point, axis=axis, mark=mark)
    axes = np.asarray(hinge.axes_j)

    def mechanism(size):
        """Body j's side moved by `size` times the shift, its axis turned about its x and y by that of the turn."""
        tilted = jnp.array([size * turn[1], -size * turn[0], 1.0])
        there = rs.Placement(point + size * axes @ shift, axis=axes @ tilted, mark=mark)
        here = rs.Placement(hinge.point_i, axis=hinge.axes_i[:, 2], mark=hinge.axes_i[:, 0])
        return rx.Mechanism([body], [rs.Revolute("top", "door", G, on_i=here, on_j=there)])

    nominal = mechanism(0.0)
    state = rx.State(nominal.reference, jnp.zeros(6))
    _, d = jax.jvp(lambda size: rx.misfit(nominal, mechanism(size), state), (0.0,), (1.0,))
    figure = rs.JointCompliance("top", 1e-8, 1e-6, misfit=[*-shift, *-turn], frame=G)
    _, expected = rx.ElasticJoints(nominal, [figure]).compliance(nominal, state)
    np.testing.assert_allclose(d, expected, atol=1e-12)


def test_another_centre_of_mass_is_no_misfit():
    """Hinges that stay where they are on the door fit, wherever its mass is; a hinge that moved is off by as much."""

    def door(centre, height):
        body = rs.Body("door", 20.0, (6.7, 8.3, 1.6), centre=centre)
        hinges = [rs.Revolute(name, body, G, (0, 0, z)) for name, z in (("low", 0.2), ("high", 1.8))]
        there = rs.Placement((0, 0, 1.0 + height)), rs.Placement((0, 0, 1.0))
        middle = rs.Revolute("middle", "door", G, on_i=there[0], on_j=there[1])
        return rx.Mechanism([body], [*hinges, middle])

    nominal = door((0.5, 0, 1.0), 0.0)
    state = rx.assemble(nominal, positions={"low.angle": 0.4})
    found = rx.misfit(nominal, door((0.52, 0.01, 1.1), 1e-3), state)
    axial = nominal.rows.labels.index("middle.axial")
    np.testing.assert_allclose(found, 1e-3 * np.eye(15)[axial], atol=1e-15)


@pytest.mark.slow
def test_a_planar_press_built_in_space_has_the_planar_loads():
    """Two guides of a ram on a crank: the loads in the plane under the same compliance and misfit."""
    names, masses, inertias = ("crank", "rod", "ram"), (2.0, 1.5, 10.0), (0.01, 0.02, 0.3)
    pins = {
        "O": ("crank", G, (-0.1, 0.0), (0.0, 0.0)),
        "P": ("rod", "crank", (-0.25, 0.0), (0.1, 0.0)),
        "Q": ("ram", "rod", (0.0, 0.1), (0.25, 0.0)),
    }
    guides = {"L": ("ram", G, (-0.3, 0.0), (-0.3, 0.0)), "R": ("ram", G, (0.3, 0.0), (0.3, 0.0))}
    flat = rx.Mechanism(
        [rx.Body(*figures) for figures in zip(names, masses, inertias, strict=True)],
        [rx.Revolute(name, *of) for name, of in pins.items()]
        + [rx.Translational(name, *of, normal=(1.0, 0.0)) for name, of in guides.items()],
        loads=[rx.AppliedForce("crank", moment=-5.0), rx.AppliedForce("ram", force=(3.0, 7.0), point=(0.1, 0.2))],
        gravity=(0.0, -9.81),
    )
    guess = {"crank.y": 0.1, "rod.x": 0.1, "rod.y": -0.1, "ram.y": -0.5, "rod.phi": -1.2}
    state = rx.assemble(flat, guess, positions={"crank.phi": 0.6}, rates={"crank.phi": -1.0})

    def placed(point, axis=(0, 0, 1), mark=(1, 0, 0)):
        return rs.Placement((*point, 0.0), axis, mark)

    deep = rx.Mechanism(
        [rs.Body(n, m, (0.3 * J, 0.8 * J, J)) for n, m, J in zip(names, masses, inertias, strict=True)],
        [rs.Revolute(n, i, j, on_i=placed(si), on_j=placed(sj)) for n, (i, j, si, sj) in pins.items()]
        + [
            rs.Prismatic(n, i, j, on_i=placed(si, (0, 1, 0)), on_j=placed(sj, (0, 1, 0)))
            for n, (i, j, si, sj) in guides.items()
        ],
        loads=[
            rs.AppliedForce("crank", moment=(0.0, 0.0, -5.0)),
            rs.AppliedForce("ram", force=(3.0, 7.0, 0.0), on_i=(0.1, 0.2, 0.0)),
        ],
        gravity=(0.0, -9.81, 0.0),
    )
    (x, phi), (v, omega) = np.split(np.asarray(state.q), [6]), np.split(np.asarray(state.qd), [6])
    positions, speeds = (np.column_stack([part.reshape(3, 2), np.zeros(3)]) for part in (x, v))
    turns, none = np.column_stack([np.cos(phi / 2), 0 * phi, 0 * phi, np.sin(phi / 2)]), np.zeros((3, 2))
    there = rx.State(
        jnp.asarray([*positions.ravel(), *turns.ravel()]), jnp.asarray([*speeds.ravel(), *np.c_[none, omega].ravel()])
    )
    planar, spatial = [], []
    for name, c, r, misfit in (("L", 1e-8, 1e-6, (1e-5, 0.0, 2e-5)), ("R", 3e-8, 2e-6, (-2e-5, 0.0, 1e-5))):
        planar.append(rx.JointCompliance(name, c, r, misfit=misfit, frame=G, point=(0.2, 0.1)))
        across, _, turn = misfit  # the guide's axis z is global y, its x global x, its y against global z
        given = {"misfit": (across, 0.0, 0.0, 0.0, -turn, 0.0), "frame": G, "point": (0.2, 0.1, 0.0)}
        spatial.append(rs.JointCompliance(name, c, r, **given))
    one = rx.solve(flat, state, closure=rx.ElasticJoints(flat, planar))
    two = rx.solve(deep, there, closure=rx.ElasticJoints(deep, spatial))
    size = np.max(np.abs(one.multipliers))
    for name, (i, *_) in (pins | guides).items():
        for part in ("force x", "force y", "moment"):
            spatial_part = "moment z" if part == "moment" else part
            np.testing.assert_allclose(
                two[f"{name} {spatial_part} on {i}"], one[f"{name} {part} on {i}"], atol=1e-10 * size
            )
    np.testing.assert_allclose(two["crank.phi_z''"], one["crank.phi''"], rtol=1e-10)


def test_stiffness_is_the_inverse_of_compliance_inside_of_jit_too():
    matrix = np.array([[3.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 4.0]])

    def given():
        return rs.JointCompliance.from_stiffness("top", 1e8 * matrix, (1e6, np.inf, 2e6)).compliance

    expected = block_diag(np.linalg.inv(matrix) / 1e8, np.diag([1e-6, 0.0, 5e-7]))
    for found in (given(), jax.jit(given)()):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-22)


def test_figures_that_do_not_fit_are_refused():
    mechanism = door()
    for bad, words in (
        (lambda: rs.JointCompliance("top", (1.0, 2.0)), "`translation` of joint 'top' must be a number or"),
        (lambda: rs.JointCompliance("top", misfit=(1.0, 2.0, 3.0)), "of joint 'top' .* shifts x, y, z, then turns"),
        (lambda: rs.JointCompliance("top", 1e-8, coupling=1e-6 * np.eye(3)), "positive semidefinite"),
        (lambda: rs.JointCompliance("top", point=(1.0, 2.0)), "`point` must have 3 components"),
        (lambda: rx.ElasticJoints(mechanism, [rx.JointCompliance("top", 1e-8)]), "`rx.spatial.JointCompliance`"),
    ):
        with pytest.raises(rx.RedundaxError, match=words):
            bad()


def test_a_traced_misfit_beside_known_stiffness_is_that_misfit(plain):
    mechanism, state, _, _ = plain
    off = np.array([1e-4, -2e-4, 3e-4, 1e-3, 2e-3, 0.0])

    def loads(misfit):
        seats = [rs.JointCompliance(name, (1e-6, 1e-6, 2e-6), 1e-3, misfit=misfit) for name in PAIRS]
        return rx.solve(mechanism, state, closure=rx.ElasticJoints(mechanism, seats)).multipliers

    known = loads(off)
    assert np.abs(known - loads(0 * off)).max() > 1.0
    np.testing.assert_allclose(jax.jit(loads)(off), known, rtol=1e-9, atol=1e-9 * np.abs(known).max())
