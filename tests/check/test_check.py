"""The referee: logs of closed form, with a wrong load, with self-stress, in other axes, and files that are spoiled

A door of mass m on three hinges of one axis, driven by its angle phi. In its own axes its centre, at (w/2, 0, h/2),
accelerates by (-phi'^2 w/2, phi'' w/2, 0), so that all hinges together bear F = m (a - g), and about the first, at
(0, 0, z), M = (0, 0, I_z phi'') - (p - c) x F. Its z is what drives.
"""

import json

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command

MASS, WIDTH, HEIGHT, THICK, LEAN, G, FIRST = 20.0, 1.0, 2.0, 0.04, 0.05, 9.81, 0.2
TIMES = np.linspace(0.0, 1.0, 9)
OPEN, BALANCE = "not determined", "not determined, wrong"


def swing():
    """Angle, rate, acceleration, and force and moment of all hinges on the door, in its axes, about the first."""
    angle, rate, turn = 0.3 + 0.5 * np.sin(3 * TIMES), 1.5 * np.cos(3 * TIMES), -4.5 * np.sin(3 * TIMES)
    none, one = np.zeros_like(TIMES), np.ones_like(TIMES)
    gravity = np.stack([np.sin(LEAN) * np.cos(angle), -np.sin(LEAN) * np.sin(angle), -np.cos(LEAN) * one], axis=-1) * G
    at = np.stack([-(rate**2) * WIDTH / 2, turn * WIDTH / 2, none], axis=-1)
    force = MASS * (at - gravity)
    inertia = MASS / 12 * (WIDTH**2 + THICK**2)
    arm = np.array([0.0, 0.0, FIRST]) - np.array([WIDTH / 2, 0.0, HEIGHT / 2])
    moment = np.stack([none, none, inertia * turn], axis=-1) - np.cross(arm, force)
    return angle, rate, turn, force, moment


def door_log(body=" on door", sign=1.0):
    """All load on the first hinge, in axes of the door."""
    angle, rate, turn, force, moment = swing()
    log = {"t": TIMES, "hinge 1.angle": angle, "hinge 1.angle'": rate, "hinge 1.angle''": turn}
    log["hinge 1.angle torque"] = moment[:, 2]
    for k, axis in enumerate("xyz"):
        log[f"hinge 1 force {axis}{body}"] = sign * force[:, k]
        log[f"hinge 1 moment {axis}{body}"] = sign * moment[:, k] * (axis != "z")
        for hinge in (2, 3):
            log[f"hinge {hinge} force {axis}{body}"] = log[f"hinge {hinge} moment {axis}{body}"] = np.zeros_like(TIMES)
    return log


@pytest.fixture(scope="module")
def door():
    return rx.mechanisms.door(lean=LEAN)


def test_what_a_door_needs_is_right_and_how_its_hinges_share_it_is_open(door):
    report = rx.check(door, door_log())
    stamps = report.stamps
    assert report.is_right and report.axes == "body" and report.redundancy == 10
    assert stamps["hinge 1.angle torque"] == "determined, right"
    assert {stamps[f"hinge {k} force {x} on door"] for k in (1, 2, 3) for x in "xyz"} == {OPEN}
    np.testing.assert_allclose(report.errors, 0.0, atol=1e-10 * MASS * G)


@pytest.mark.parametrize("other", [False, True])
def test_bodies_that_are_not_told_are_found(door, other):
    """On the frame the loads are opposite, and its axes are those of the world."""
    log, angle = door_log("", -1.0 if other else 1.0), swing()[0]
    for part in ("force", "moment") if other else ():
        x, y = (log[f"hinge 1 {part} {axis}"] for axis in "xy")
        log[f"hinge 1 {part} x"] = np.cos(angle) * x - np.sin(angle) * y
        log[f"hinge 1 {part} y"] = np.sin(angle) * x + np.cos(angle) * y
    report = rx.check(door, log)
    assert report.is_right and report.on_other is other and report.axes == ("global" if other else "body")


def test_self_stress_is_not_called_wrong_and_is_told(door):
    """The first hinge pulls up and the third down by 50 N; and the first and second twist by 7 N m."""
    log, plain = door_log(), door_log()
    for hinge, sign in ((1, 1.0), (3, -1.0)):
        log[f"hinge {hinge} force z on door"] = plain[f"hinge {hinge} force z on door"] + sign * 50.0
    for hinge, sign in ((1, 1.0), (2, -1.0)):
        log[f"hinge {hinge} moment x on door"] = plain[f"hinge {hinge} moment x on door"] + sign * 7.0
    report, without = rx.check(door, log), rx.check(door, plain)
    assert report.is_right
    added = dict(zip(report.names, (report.stress - without.stress).T, strict=True))
    np.testing.assert_allclose(added["hinge 1 force z on door"] - added["hinge 3 force z on door"], 100.0, rtol=1e-6)


def test_a_total_that_is_wrong_is_caught_though_no_load_of_it_is_determined(door):
    log = door_log()
    log["hinge 1 force x on door"] = 1.02 * log["hinge 1 force x on door"]
    report = rx.check(door, log)
    assert not report.is_right and BALANCE in report.stamps.values()
    assert "WRONG" in report.summary and "out of balance" in report.summary


@pytest.mark.parametrize("name", ["hinge 1.angle torque", "hinge 1 moment y on door"])
def test_two_per_cent_of_a_load_are_caught(door, name):
    log = door_log()
    log[name] = 1.02 * log[name]
    report = rx.check(door, log)
    assert not report.is_right and report.stamps[name].endswith("wrong")
    if name.endswith("torque"):
        k = report.names.index(name)
        np.testing.assert_allclose(report.worst[k], 0.02 * np.abs(door_log()[name]).max(), rtol=1e-6)


def test_derivatives_of_splines_widen_what_is_right(door):
    """Nine times of a sine are too few for its second derivative; the doubt of that is no fault of the log."""
    log = {name: values for name, values in door_log().items() if not name.endswith("'")}
    report = rx.check(door, log)
    assert report.is_right and report.splined == ("hinge 1.angle",)
    assert np.nanmax(np.abs(report.errors)) > 1e-6 * MASS * G


def test_a_closure_and_bounds_stand_beside_what_is_open(door):
    rows = ("radial_1", "radial_2", "axial", "bend_1", "bend_2")
    bounds = rx.PreloadBox({f"hinge {k}.{row}": (-10.0, 10.0) for k in (2, 3) for row in rows})
    log = {name: values for name, values in door_log().items() if not name.startswith("hinge 1 moment")}
    report = rx.check(door, log, rx.MinimumNorm(), axes="global", bounds=bounds)
    low, high = report.bands["hinge 1 force z on door"]
    np.testing.assert_allclose([low, high], MASS * G * np.cos(LEAN) + np.array([-20.0, 20.0]), rtol=1e-9)
    by = dict(zip(report.names, report.closed.T, strict=True))
    total = sum(by[f"hinge {k} force z on door"] for k in (1, 2, 3))
    np.testing.assert_allclose(total, MASS * G * np.cos(LEAN), rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"t": None}, "must have a column `t`"),
        ({"t": TIMES[::-1]}, "ascend"),
        ({"hinge 1.angle": None, "hinge 1.angle'": None, "hinge 1.angle''": None}, "1 freedom is left"),
        ({"hinge 1 force x on roof": TIMES}, "joins 'door' and 'ground'"),
        ({"hinge 2 force x on door": np.full(9, np.nan)}, "must hold finite numbers"),
        ({"hinge 2 force x on door": ["a"] * 9}, "must hold numbers"),
        ({"hinge 2 force x on door": np.zeros(4)}, "has another size"),
        ({"hinge 1": TIMES}, "'hinge 1' is told by another column of 'hinge 1.angle' too"),
    ],
)
def test_logs_that_do_not_fit_are_told_in_a_line(door, change, told):
    log = {name: values for name, values in (door_log() | change).items() if values is not None}
    with pytest.raises(rx.RedundaxError, match=r"^Argument `log`[^\n]*\.$") as caught:
        rx.check(door, log)
    assert told in str(caught.value)


def test_columns_that_are_no_loads_are_told_with_near_names(door):
    with pytest.raises(rx.RedundaxError, match="Did you mean 'hinge 1 force x on door'"):
        rx.check(door, {"t": TIMES, "hinge 1 forse x on door": TIMES})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "must have a line of names"),
        ("t,a,a\n0,1,2\n", "has the column 'a' twice"),
        ("t,a\n0,1\n1\n", "has 1 cells in line 3"),
        ("t;a\n0;x\n", "has 'x' in line 2"),
    ],
)
def test_files_that_are_spoiled_are_told_in_a_line(door, tmp_path, text, told):
    file = tmp_path / "log.csv"
    file.write_text(text)
    with pytest.raises(rx.RedundaxError, match=r"^Argument `log`[^\n]*\.$|\?$") as caught:
        rx.check(door, file)
    assert told in str(caught.value)


def test_files_are_read_with_units_short_names_and_decimal_commas(door, tmp_path):
    log = door_log()
    short = {"t": "Time [s]"} | {name: name for name in log if "." in name}
    short |= {f"hinge {k} {part} {x} on door": f"hinge {k}.{part[0]}{x} on door [N]" for k in (1, 2, 3)
              for part in ("force", "moment") for x in "xyz"}  # fmt: skip
    rows = [";".join(short[name] for name in log)]
    rows += [";".join(repr(float(values[k])).replace(".", ",") for values in log.values()) for k in range(len(TIMES))]
    (tmp_path / "log.csv").write_text("\n".join(rows), encoding="utf-8-sig")
    report = rx.check(door, tmp_path / "log.csv")
    assert report.is_right and not report.unused and len(report.names) == 19


@pytest.mark.parametrize(
    ("column", "unit", "own"),
    [
        ("t", "ms", "s"),
        ("hinge 1.angle", "deg", "rad"),
        ("hinge 1.angle''", "°/s²", "rad/s²"),
        ("hinge 1 force x on door", "kN", "N"),
        ("hinge 1.angle torque", "N*mm", "N m"),
    ],
)
def test_columns_in_other_units_than_the_model_are_refused(door, column, unit, own):
    """And those in its own, or in one that is not known, are read."""
    for stands, is_right in ((unit, False), (own, True), ("?", True)):
        log = {f"{name} [{stands}]" if name == column else name: values for name, values in door_log().items()}
        if is_right:
            assert rx.check(door, log).is_right
        else:
            with pytest.raises(rx.RedundaxError, match=f"in place of {own}. Convert it"):
                rx.check(door, log)


def test_the_command_ends_with_3_where_a_load_is_wrong(tmp_path, capsys):
    (tmp_path / "door.py").write_text(
        "import jax.numpy as jnp\nimport redundax as rx\n"
        f"door = rx.mechanisms.door(lean={LEAN})\nstate = rx.State(door.reference, jnp.zeros(6))\n"
    )
    log = door_log()
    for factor, status in ((1.0, 0), (1.02, 3)):
        table = log | {"hinge 1.angle torque": factor * log["hinge 1.angle torque"]}
        rows = [",".join(table), *(",".join(repr(float(x[k])) for x in table.values()) for k in range(len(TIMES)))]
        (tmp_path / "log.csv").write_text("\n".join(rows))
        given = ["check", f"{tmp_path / 'door.py'}:door", str(tmp_path / "log.csv"), "--json"]
        assert command.main(given) == status
        found = json.loads(capsys.readouterr().out)
        assert found["right"] is (status == 0) and found["figures"]["hinge 1.angle torque"]["stamp"].startswith(
            "determined"
        )


def test_a_picture_shows_what_is_wrong_first(door):
    log = door_log()
    log["hinge 1.angle torque"] = 1.02 * log["hinge 1.angle torque"]
    figure = rx.plot.check(rx.check(door, log))
    assert figure.axes[0].get_title() == "hinge 1.angle torque: determined, wrong" and len(figure.axes) == 6


def test_a_machine_without_mass_bears_nothing_and_what_a_log_adds_is_wrong():
    pin = rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    rod = rx.Mechanism([rx.Body("rod", 0.0, 0.0)], [pin])
    log = {"t": TIMES, "O": TIMES, "O'": 1 + 0 * TIMES, "O''": 0 * TIMES, "O.fx": 0 * TIMES, "O.fy": 0 * TIMES}
    q = jnp.array([0.5, 0.0, 0.0])
    assert rx.check(rod, log, q=q).is_right
    assert not rx.check(rod, log | {"O.fx": 1 + TIMES}, q=q).is_right


def test_the_plane_is_judged_as_well():
    """A rod on one pin, w t from below: the pin bears m (a - g), and all of it is determined."""
    pin = rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    rod = rx.Mechanism([rx.Body("rod", 2.0, 0.1)], [pin], gravity=(0.0, -G))
    angle, rate = 1.5 * TIMES - 1.0, 1.5
    force = 2.0 * np.stack([-0.5 * rate**2 * np.cos(angle), -0.5 * rate**2 * np.sin(angle) + G], axis=-1)
    log = {"t": TIMES, "O": angle, "O'": rate + 0 * TIMES, "O''": 0 * TIMES, "O.fx": force[:, 0], "O.fy": force[:, 1]}
    q = jnp.array([0.5 * np.cos(-1.0), 0.5 * np.sin(-1.0), -1.0])
    report = rx.check(rod, log, q=q)
    assert set(report.stamps.values()) == {"determined, right"} and np.nanmax(report.worst) < 1e-10
    assert rx.check(rod, log | {"O.fy": 1.02 * force[:, 1]}, q=q).stamps["O.fy"] == "determined, wrong"
