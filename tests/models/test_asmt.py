"""Files of ASMT: what is read of them, a stored run, and what is said of those that are spoiled

A crank of mass m on a pin along z, whose centre is at c from it, turns by w t^2 / 2 in gravity g along -y. Its pin
bears m (a - g) with a the acceleration of the centre, and the motion (I + m c^2) w + m g c cos(w t^2 / 2).
"""

import asmt
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._models._formats import describe
from redundax._models._formula import law_of
from redundax._models._tree import Tree

PART = "X Y Z Bryantx Bryanty Bryantz VX VY VZ OmegaX OmegaY OmegaZ"
LOAD = "FXonI FYonI FZonI TXonI TYonI TZonI"
MASS, CENTRE, MOMENT, W, G = 2.0, 0.3, 0.05, 4.0, 9.81
AXES = {  # of a marker whose z is along x, y and z
    "x": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "y": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
}


def crank_run(times):
    """The closed form, as the rows of a file: the loads are those on the ground, marker I."""
    angle, rate = W * times**2 / 2, W * times
    none, one = np.zeros_like(times), np.ones_like(times)
    x, y = CENTRE * np.cos(angle), CENTRE * np.sin(angle)
    force = MASS * np.stack([-(rate**2) * x - W * y, -(rate**2) * y + W * x + G, none], axis=-1)
    torque = (MOMENT + MASS * CENTRE**2) * W + MASS * G * x
    poses = np.stack([none, none, none, none, none, angle, *([none] * 5), rate], axis=-1)
    pin = np.concatenate([-force, np.zeros((len(times), 3))], axis=1)
    drive = np.stack([*([none] * 5), -torque * one], axis=-1)
    series = [("PartSeries /rig/crank", PART, poses), ("RevoluteJointSeries /rig/pin", LOAD, pin)]
    return asmt.run(times, [*series, ("RotationalMotionSeries /rig/turn", LOAD, drive)])


@pytest.fixture
def write(tmp_path):
    def written(text, name="rig.asmt"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


def crank(times=(), formula="2.0d*time^2"):
    part = asmt.part("crank", (0, 0, 0), None, MASS, (CENTRE, 0, 0), (0.01, 0.05, MOMENT), {"eye": (0, 0, 0)})
    return asmt.assembly(
        {"base": (0, 0, 0)},
        [part],
        [asmt.joint("RevoluteJoint", "pin", "base", "crank/eye")],
        [asmt.motion("RotationalMotion", "turn", "pin", "RotationZ", formula)],
        (0.0, -G, 0.0),
        crank_run(np.asarray(times)) if len(times) else (),
    )


def four_bar(last="RevoluteJoint", limits=(), gravity=(0.0, 0.0, 0.0), **values):
    """A parallelogram of own numbers, 0.2 by 0.5 m, in the plane across z, a part turned in its file."""
    quarter = ((0, -1, 0), (1, 0, 0), (0, 0, 1))
    arm = ("arm", (0, 0, 0), quarter, 1.0, (0.1, 0, 0), (0.01, 0.01, 0.01), {"a": (0, 0, 0), "b": (0.2, 0, 0)})
    bar = ("bar", (0, 0.2, 0), None, 1.5, (0.25, 0, 0), (0.01, 0.02, 0.02), {"a": (0, 0, 0), "b": (0.5, 0, 0)})
    strut = ("strut", (0.5, 0, 0), None, 1.0, (0, 0.1, 0), (0.01, 0.01, 0.01), {"a": (0, 0, 0), "b": (0, 0.2, 0)})
    joints = [
        asmt.joint("RevoluteJoint", "p", "base", "arm/a"),
        asmt.joint("RevoluteJoint", "q", "arm/b", "bar/a"),
        asmt.joint("RevoluteJoint", "r", "bar/b", "strut/b"),
        asmt.joint(last, "s", "strut/a", "other", **values),
    ]
    parts = [asmt.part(*each) for each in (arm, bar, strut)]
    return asmt.assembly({"base": (0, 0, 0), "other": (0.5, 0, 0)}, parts, joints, (), gravity, limits=limits)


def test_a_stored_run_is_that_of_the_closed_form_and_so_are_the_loads_of_the_mechanism(write):
    times = np.array([0.0, 0.3, 0.7])
    model = rx.load_model(write(crank(times)))
    series, driven = model.series, model.driven
    assert series.reactions["pin"].on == "ground" and model.described.drives == ("turn",)
    for k, t in enumerate(series.times):
        angle, rate = W * t**2 / 2, W * t
        axes = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        np.testing.assert_allclose(series.bodies["crank"].axes[k], axes, atol=1e-15)
        state = rx.assemble(driven, model.guess({"pin": angle}), rates={"pin.angle": rate}, t=t)
        solution = rx.solve(driven, state)
        ours = [solution[f"pin force {x} on crank"] for x in "xyz"]
        np.testing.assert_allclose(ours, -series.reactions["pin"].force[k], atol=1e-9 * MASS * G)
        np.testing.assert_allclose(
            float(solution["turn moment z on crank"]), -series.reactions["turn"].moment[k, 2], rtol=1e-9
        )


@pytest.mark.parametrize("given", [{"drives": ["nothing.angle"]}, {"axes": "body"}])
def test_a_stored_run_tells_its_motion_and_axes_itself(write, given):
    model = rx.load_model(write(crank(np.linspace(0.0, 0.7, 8))))
    assert rx.check(model.driven, model.series, axes="global").is_right
    with pytest.raises(rx.RedundaxError, match="`axes` and `drives` must be left out where `log` is the stored run"):
        rx.check(model.driven, model.series, **given)


@pytest.mark.parametrize(
    ("last", "values", "redundant", "kind"),
    [
        ("RevoluteJoint", {}, 3, "hinge"),
        ("CylindricalJoint", {}, 2, "cylindrical joint"),
        ("SphericalJoint", {}, 1, "connect"),
        ("PointInLineJoint", {}, 0, "point-on-line joint"),
        ("PointInPlaneJoint", {"offset": 0.0}, 1, "point-on-plane joint"),
    ],
)
def test_a_parallelogram_is_redundant_by_what_closes_it(write, last, values, redundant, kind):
    """A plate across z adds one row that the three hinges hold already, and leaves two freedoms."""
    described = describe(write(four_bar(last, **values)))
    tree = Tree(described)
    slopes = tree.system(tree.reference)[1]
    rank = int(np.linalg.matrix_rank(slopes, tol=1e-9))
    assert tree.misfit(tree.reference) < 1e-14
    assert [loop.kind for loop in described.loops] == [kind]
    assert (len(slopes) - rank, tree.nv - rank) == (redundant, 3 if last == "PointInPlaneJoint" else 1)


@pytest.mark.parametrize(
    ("kind", "rows", "values"),
    [
        ("RevoluteJoint", 5, {}),
        ("CylindricalJoint", 4, {}),
        ("TranslationalJoint", 5, {}),
        ("SphericalJoint", 3, {}),
        ("PlanarJoint", 3, {"offset": 0.1}),
        ("FixedJoint", 6, {}),
        ("ConstantVelocityJoint", 4, {}),
        ("PointInLineJoint", 2, {}),
        ("PointInPlaneJoint", 1, {"offset": 0.1}),
        ("ParallelAxesJoint", 2, {}),
        ("AngleJoint", 2, {"theIzJz": 0.0}),
        ("UniversalJoint", 4, {}),
        ("SphSphJoint", 1, {"distanceIJ": 0.1}),
        ("AngleJoint", 1, {"theIzJz": np.pi / 2}),
        ("PerpendicularJoint", 1, {}),
        ("NoRotationJoint", 3, {}),
    ],
)
def test_each_joint_holds_its_rows_in_a_tree_and_in_a_loop(write, kind, rows, values):
    """The plate stands 0.1 m along z where the joint asks for it; a cross needs axes that are square."""
    is_square = kind in ("UniversalJoint", "PerpendicularJoint") or values.get("theIzJz")
    eye = ((0.0, 0.0, 0.0), AXES["x"]) if is_square else (0, 0, 0)
    place = (0, 0, 0.1) if values.get("offset") or kind == "SphSphJoint" else (0, 0, 0)
    part = asmt.part("plate", place, None, 1.0, (0, 0, 0), (0.1, 0.1, 0.1), {"eye": eye})
    joints = [asmt.joint(kind, name, "base", "plate/eye", **values) for name in ("one", "two")]
    model = rx.load_model(write(asmt.assembly({"base": (0, 0, 0)}, [part], joints)))
    assert len(model.mechanism.rows) == 2 * rows
    residual = np.asarray(model.mechanism.constraint(model.state.q, jnp.zeros(())))
    np.testing.assert_allclose(residual, 0.0, atol=1e-14)
    jacobian = np.asarray(model.mechanism.jacobian(model.state.q, jnp.zeros(())))
    assert np.linalg.matrix_rank(jacobian, tol=1e-9) == rows


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        ("RevoluteJoint", "MagnetJoint", None),
        ("\t\t\t\t\t2.0\n", "\t\t\t\t\t-2.0\n", "gives 'crank' the mass -2"),
        ("\t\t\t\tMass\n", "\t\t\t\tWeight\n", "has no `Mass`"),
        ("/rig/crank/eye", "/rig/crank/ear", "holds the marker '/rig/crank/ear'"),
        ("2.0d*time^2", "__import__('os').getcwd()", "which is no formula of time"),
        ("1.0\t0.0\t0.0\t\n", "1.0\tnan\t0.0\t\n", "must have 3 numbers"),
        ("OndselSolver\n", "<robot/>\n", "holds URDF"),
        ("OndselSolver\n", "Something\n", "is no ASMT"),
        ("\tParts\n", "\t\t\t\t\tParts\n", "is indented too far in line"),
    ],
)
def test_spoiled_files_are_told_in_a_line(write, was, now, told, capsys):
    file = write((crank() if told else four_bar()).replace(was, now, 1 if told is None else -1))
    if told is None:
        assert command.main(["audit", str(file)]) == 4
        assert "MagnetJoint 'p' is left out" in capsys.readouterr().out
        return
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`") as caught:
        rx.load_model(file)
    assert told in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.55, 0.8, 0.93])
def test_files_that_are_cut_off_are_told_in_a_line(write, share):
    text = crank()
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*\.$"):
        rx.load_model(write(text[: int(share * len(text))]))


def test_names_with_markup_stay_names(write):
    model = rx.load_model(write(crank().replace("crank", "<b>&amp;</b>")))
    assert tuple(model.mechanism.names.bodies) == ("<b>&amp;</b>",)


# As the program before OndselSolver writes a ramp: its own words in quotes, and <n> for the end of a line.
RAMP = (
    '-1*("((1/pi)*(arctan(1000*(time - T1)) - arctan(1000*(time - T2))))*(H1)"<n>((1/pi)*(arctan(1000*(time - (-1)))'
    " - arctan(1000*(time - 2))))*((((-0.5) - (-1))/(2 - (-1)))*(time - (-1)) + (-1))<n>+<n>0)"
)


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        (RAMP, 7 / 12 * (np.arctan(2500.0) + np.arctan(500.0)) / np.pi),
        ("asin(0.5)<n>+ time", np.pi / 6 + 1.5),
        ('"1.0 + "2.0d*time', 3.0),
    ],
)
def test_formulas_are_read_as_ondsel_and_its_forerunner_write_them(formula, value):
    law = law_of(formula)
    np.testing.assert_allclose(law(1.5), value, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(law)(1.5), value, rtol=1e-12)


def nut(*more, limits=()):
    """A nut of 2 kg on a vertical guide, by joints besides its cylindrical one."""
    part = asmt.part("nut", (0, 0, 0), None, 2.0, (0, 0, 0), (0.1, 0.1, 0.1), {"eye": (0, 0, 0)})
    joints = [asmt.joint("CylindricalJoint", "guide", "base", "nut/eye"), *more]
    return asmt.assembly({"base": (0, 0, 0)}, [part], joints, (), (0.0, 0.0, -G), limits=limits)


def test_a_screw_turns_its_weight_into_a_moment(write):
    """By a pitch p each turn the weight m g falls by p: with it a spindle that is held bears m g p / 2 pi."""
    screw = asmt.joint("ScrewJoint", "thread", "base", "nut/eye", pitch=0.02)
    stop = asmt.joint("NoRotationJoint", "key", "base", "nut/eye")
    model = rx.load_model(write(nut(screw, stop)))
    report = rx.analyze(model.mechanism, model.state)
    assert (len(model.mechanism.rows), report.redundancy, report.freedom) == (8, 2, 0) and not model.notes
    solution = rx.solve(model.mechanism, model.state)
    np.testing.assert_allclose(abs(float(solution["key moment z on nut"])), MASS * G * 0.02 / (2 * np.pi), rtol=1e-9)


@pytest.mark.parametrize("flip", [False, True])
def test_wheels_in_mesh_press_tangentially(write, flip):
    """A pinion, r = 0.1, turns a wheel, R = 0.3, both on pins, by b: the teeth bear F = J b r / R^2, and the pins the
    same force across the line of centres, x here; the motor (I + J r^2 / R^2) b."""
    b, moments = 4.0, (0.05, 0.9)
    wheels = [
        asmt.part(name, place, None, 0.0, (0, 0, 0), (0.0, 0.0, moment), {"eye": (0, 0, 0)})
        for name, place, moment in zip(("pinion", "wheel"), ((0, 0, 0), (0.4, 0, 0)), moments, strict=True)
    ]
    ends, radii = ("pinion/eye", "wheel/eye"), (0.2, 0.6)  # whose ratio alone counts
    ends, radii = (ends[::-1], radii[::-1]) if flip else (ends, radii)
    mesh = asmt.joint("GearJoint", "mesh", *ends, radiusI=radii[0], radiusJ=radii[1])
    joints = [asmt.joint("RevoluteJoint", "p", "a", "pinion/eye"), asmt.joint("RevoluteJoint", "w", "b", "wheel/eye")]
    motion = asmt.motion("RotationalMotion", "turn", "p", "RotationZ", "2.0d*time^2")
    text = asmt.assembly({"a": (0, 0, 0), "b": (0.4, 0, 0)}, wheels, [*joints, mesh], [motion], (0.0, 0.0, 0.0))
    model = rx.load_model(write(text))
    tree = Tree(model.described)
    assert tree.misfit(tree.reference) < 1e-14 and len(tree.system(tree.reference)[1]) == 1
    solution = rx.solve(model.driven, rx.State(model.state.q, model.state.qd, jnp.zeros(())))
    force = moments[1] * b * 0.1 / 0.3**2
    np.testing.assert_allclose(float(solution["w.angle''"]), -b / 3, rtol=1e-12)
    np.testing.assert_allclose(abs(float(solution["w force y on wheel"])), force, rtol=1e-12)
    np.testing.assert_allclose(abs(float(solution["p force y on pinion"])), force, rtol=1e-12)
    np.testing.assert_allclose(float(solution["w force x on wheel"]), 0.0, atol=1e-12)
    torque = moments[0] * b + force * 0.1
    np.testing.assert_allclose(abs(float(solution["turn moment z on pinion"])), torque, rtol=1e-12)


@pytest.mark.parametrize("other", [-0.2, -0.1, -0.6, 0.0])
def test_a_belt_is_left_out_as_its_forces_are_not_those_of_teeth(write, other):
    parts = [
        asmt.part(name, place, None, 0.0, (0, 0, 0), (0.1, 0.1, 0.1), {"eye": (0, 0, 0)})
        for name, place in (("pinion", (0, 0, 0)), ("wheel", (0.4, 0, 0)))
    ]
    joints = [asmt.joint("RevoluteJoint", "p", "a", "pinion/eye"), asmt.joint("RevoluteJoint", "w", "b", "wheel/eye")]
    belt = asmt.joint("GearJoint", "belt", "pinion/eye", "wheel/eye", radiusI=0.2, radiusJ=other)
    text = asmt.assembly({"a": (0, 0, 0), "b": (0.4, 0, 0)}, parts, [*joints, belt], [], (0.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="is read without GearJoint 'belt'"):
        model = rx.load_model(write(text))
    assert any("those of a belt" in note for note in model.notes)


def test_a_rack_and_a_pinion(write):
    """A weight m on an upright rack turns a pinion of radius r on its pin: it falls by g m r^2 / (m r^2 + I)."""
    up = ((0.0, 0.0, 0.0), ((0, -1, 0), (1, 0, 0), (0, 0, 1)))  # x along y
    slide = ((0.0, 0.0, 0.0), ((1, 0, 0), (0, 0, 1), (0, -1, 0)))  # z along y
    parts = [
        asmt.part("rack", (0.1, 0.7, 0), None, 2.0, (0, 0, 0), (0.1, 0.1, 0.1), {"teeth": up, "eye": slide}),
        asmt.part("pinion", (0, 0, 0), None, 1.0, (0, 0, 0), (0.1, 0.1, 0.03), {"eye": (0, 0, 0)}),
    ]
    joints = [
        asmt.joint("TranslationalJoint", "guide", "foot", "rack/eye"),
        asmt.joint("RevoluteJoint", "pin", "base", "pinion/eye"),
        asmt.joint("RackPinionJoint", "mesh", "rack/teeth", "pinion/eye", pitchRadius=0.1),
    ]
    places = {"base": (0, 0, 0), "foot": ((0.1, 0.0, 0.0), slide[1])}
    model = rx.load_model(write(asmt.assembly(places, parts, joints, (), (0.0, -G, 0.0))))
    solution = rx.solve(model.mechanism, model.state)
    fall = G * 2 * 0.1**2 / (2 * 0.1**2 + 0.03)
    np.testing.assert_allclose(abs(float(solution["guide.travel''"])), fall, rtol=1e-12)
    np.testing.assert_allclose(abs(float(solution["pin.angle''"])), fall / 0.1, rtol=1e-12)
    np.testing.assert_allclose(float(solution["pin force y on pinion"]), G + 0.03 * fall / 0.1**2, rtol=1e-12)
    assert rx.analyze(model.mechanism, model.state).redundancy == 0


def test_rows_of_teeth_are_slopes_of_what_they_close(write):
    """By differences, where the joints are apart."""
    joints = [asmt.joint("ScrewJoint", "thread", "base", "nut/eye", pitch=0.3),
              asmt.joint("RackPinionJoint", "mesh", "nut/eye", "base", pitchRadius=0.2)]  # fmt: skip
    tree = Tree(describe(write(nut(*joints).replace("CylindricalJoint", "PlanarJoint"))))
    at = tree.moved(tree.reference, np.array([0.03, 0.02, 0.4]))
    steps = [[tree.system(tree.moved(at, h * axis))[0] for h in (1e-6, -1e-6)] for axis in np.eye(3)]
    differences = np.array([(after - before) / 2e-6 for after, before in steps]).T
    np.testing.assert_allclose(tree.system(at)[1], differences, atol=1e-8)  # rounding over the step


def hanging(kind, at=(0.0, -0.5, 0.3), eye=(0, 0, 0), **values):
    part = asmt.part("bob", at, None, 2.0, (0, 0, 0), (0.1, 0.1, 0.1), {"eye": eye})
    return asmt.assembly(
        {"base": (0, 0, 0)}, [part], [asmt.joint(kind, "r", "base", "bob/eye", **values)], (), (0, -G, 0)
    )


@pytest.mark.parametrize(("kind", "freedom"), [("RevRevJoint", 2), ("RevCylJoint", 3), ("CylSphJoint", 5)])
def test_joints_at_a_distance_from_an_axis_are_rods(write, kind, freedom):
    """Whatever the positions, the point of J is 0.5 from the axis z of I, and what the joint holds besides is held."""
    described = describe(write(hanging(kind, distanceIJ=0.5)))
    tree = Tree(described)
    assert (tree.nv, described.loops, [body.name for body in described.bodies]) == (
        freedom,
        (),
        ["ground", "rod of r", "bob"],
    )
    step = np.linspace(0.3, -1.2, tree.nv)
    poses, bob = tree.at(tree.moved(tree.reference, step)), described.bodies[2]
    place = poses.turns[2] @ bob.position + poses.shifts[2]
    np.testing.assert_allclose(np.linalg.norm(place[:2]), 0.5, rtol=1e-12)
    up = (poses.turns[2] @ bob.axes)[:, 2]
    assert kind == "CylSphJoint" or abs(up[2] - 1) < 1e-12
    assert (abs(place[2]) < 1e-12) == (kind == "RevRevJoint")


def test_a_rod_bears_what_hangs_on_it(write):
    model = rx.load_model(write(hanging("CylSphJoint", distanceIJ=0.5)))
    solution = rx.solve(model.mechanism, model.state)
    np.testing.assert_allclose(float(solution["far end of r force y on bob"]), 2 * G, rtol=1e-12)
    model = rx.load_model(write(hanging("RevRevJoint", at=(0.0, -7.0, 0.0), distanceIJ=0.5)))  # not closed in the file
    np.testing.assert_allclose(model.described.bodies[2].position, (0.0, -0.5, 0.0), atol=1e-12)


def test_a_line_in_a_plane_leaves_four_motions(write):
    eye = ((0.0, 0.0, 0.0), AXES["x"])
    tree = Tree(describe(write(hanging("LineInPlaneJoint", (0.4, 0.0, 0.2), eye, offset=0.2))))
    residual, slopes = tree.system(tree.reference)
    assert np.abs(residual).max() < 1e-14 and np.linalg.matrix_rank(slopes) == 2 and tree.nv == 6
    away, lifted, tipped = (np.eye(6)[k] * 0.1 for k in (0, 2, 4))
    misfits = [np.abs(tree.system(tree.moved(tree.reference, step))[0]).max() for step in (away, lifted, tipped)]
    np.testing.assert_allclose(misfits, [0.0, 0.1, np.sin(0.1)], atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("RevCylJoint", {}),
        ("CurveCurveContact", {}),
        ("GearJoint", {"radiusI": np.pi, "radiusJ": 1.0}),
        ("ScrewJoint", {"pitch": 0.0}),
    ],
)
def test_couplings_that_are_not_taken_over_are_told_and_undecided(write, kind, values, capsys):
    assert command.main(["audit", str(write(nut(asmt.joint(kind, "mesh", "base", "nut/eye", **values))))]) == 4
    assert f"{kind} 'mesh' is left out" in capsys.readouterr().out


def test_limits_are_stops_where_they_are_asked_for(write):
    """A nut that rests on the lower end of its guide."""
    slide = nut(limits=[("TranslationLimit", "guide", "0.0", "=>"), ("TranslationLimit", "guide", "0.5d", "=<")])
    model = rx.load_model(write(slide.replace("CylindricalJoint", "TranslationalJoint")))
    assert model.described.joints[0].limits == (0.0, 0.5)
    stopped = model.stopped
    assert len(stopped.rows) == 2 + len(model.mechanism.rows)
    solution = rx.solve(stopped, model.state)
    np.testing.assert_allclose(float(solution["stop of guide.least"]), MASS * G, rtol=1e-9)


@pytest.mark.parametrize(("sign", "side", "share"), [("=>", "least", 1.0), ("=<", "most", 0.0)])
def test_limits_of_a_joint_that_closes_a_loop_are_stops_too(write, sign, side, share):
    """Gravity along -x turns legs of 1 kg and the bar of 1.5 kg on them to the left, by g (2 0.1 + 1.5 0.2) N m: the
    base, marker J, turns to the right as a leg sees it, so that its least angle holds it, and its largest does not."""
    limits = [("RotationLimit", "s", "0.0", sign)]
    model = rx.load_model(write(four_bar(limits=limits, gravity=(-G, 0.0, 0.0))))
    assert [loop.name for loop in model.described.loops] == ["s"]
    solution = rx.solve(model.stopped, model.state)
    np.testing.assert_allclose(float(solution[f"stop of s.{side}"]), share * 0.5 * G, rtol=1e-9, atol=1e-12)
    assert any("stops at the limits of 1 joint" in note for note in model.notes)


def test_what_cannot_close_is_told_with_what_the_file_itself_has_open(write):
    """A ground pin 5 m away, and a bar 0.01 m off the pin that it hangs on."""
    text = four_bar().replace("0.5\t0.0\t0.0", "5.0\t0.0\t0.0", 1).replace("0.0\t0.2\t0.0", "0.0\t0.21\t0.0", 1)
    with pytest.raises(rx.NoSolutionError, match=r"leaves open 's' by .* closing of 'q' moved 'bar' by 0.01 \(m or"):
        rx.load_model(write(text))


@pytest.mark.parametrize("was", ["Time\tInput\t0.0\t", "FXonI\t0\t"])
def test_a_stored_run_that_is_spoiled_is_told_and_the_rest_is_read(write, was, capsys):
    file = write(crank((0.0, 0.3)).replace(was, was + "1.0\t", 1))
    model = rx.load_model(file)
    assert model.series is None and any("stored run of a file that must have" in note for note in model.notes)
    assert command.main(["check", str(file)]) == 2
    assert "must have" in capsys.readouterr().err


def test_files_of_the_older_workbench_are_read(write):
    assert len(rx.load_model(write(crank().replace("OndselSolver", "FreeCADMbD", 1))).mechanism.rows) == 5


def test_joints_without_a_name_have_that_of_their_kind(write):
    model = rx.load_model(write(crank().replace("\t\t\t\t\tpin\n", "\t\t\t\t\t\n", 1)))
    assert tuple(model.mechanism.names.joints[0]) == ("RevoluteJoint",)
