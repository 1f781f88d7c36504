"""Loads of bodies for finite elements: in balance, in axes of the body, about the joints' points, and as cards

A door of mass m that rests on hinges: each body's loads sum to nothing, and all its weight hangs on them.
"""

import csv

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._finite_elements._body_loads import as_calculix, as_csv

MASS, WIDTH, HEIGHT, G = 20.0, 1.0, 2.0, 9.81


@pytest.fixture(scope="module")
def turned():
    """A door that is open by a right angle and swings, and a flap with a ball on it."""
    door = rx.spatial.Body("door", MASS, inertia=(7.0, 8.0, 1.6), centre=(WIDTH / 2, 0.0, HEIGHT / 2))
    flap = rx.spatial.Body("flap", 2.0, inertia=(0.1, 0.2, 0.2), centre=(0.2, 0.0, 0.0), position=(1.0, 0.0, 1.0))
    hinges = [rx.spatial.Revolute(f"hinge {k}", door, "ground", point=(0.0, 0.0, z)) for k, z in ((1, 0.2), (2, 1.8))]
    pin = rx.spatial.Revolute("pin", "ground", flap, point=(1.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    machine = rx.Mechanism([door, flap], [*hinges, pin], gravity=(0.0, 0.0, -G))
    state = rx.assemble(machine, positions={"hinge 1.angle": np.pi / 2}, rates={"hinge 1.angle": 2.0, "pin.angle": 0.5})
    return machine, state, rx.solve(machine, state)


def test_all_loads_of_a_body_are_in_balance(turned):
    loads = rx.spatial.body_loads(*turned)
    assert [(load.body, load.joint) for load in loads] == [
        ("door", "hinge 1"), ("door", "hinge 2"), ("door", ""), ("flap", "pin"), ("flap", "")]  # fmt: skip
    for body in ("door", "flap"):
        own = [load for load in loads if load.body == body]
        np.testing.assert_allclose(sum(load.force for load in own), 0.0, atol=1e-10 * MASS * G)
        moments = sum(load.moment + np.cross(load.point, load.force) for load in own)
        np.testing.assert_allclose(moments, 0.0, atol=1e-10 * MASS * G)


def test_they_are_in_axes_of_the_body_and_say_what_is_unique(turned):
    """Towards the hinges the door is pulled by m w^2 r, along its own x, wherever it is open; the pin is alone."""
    loads = rx.spatial.body_loads(*turned)
    both = loads[0].force + loads[1].force
    np.testing.assert_allclose(both, [-MASS * 2.0**2 * WIDTH / 2, 0.0, MASS * G], atol=1e-9)
    np.testing.assert_allclose([load.point for load in loads[:2]], [[0, 0, 0.2], [0, 0, 1.8]], atol=1e-15)
    np.testing.assert_allclose(loads[2].point, [WIDTH / 2, 0.0, HEIGHT / 2])
    assert not loads[0].unique[:5].any() and loads[0].unique[5]
    assert loads[3].unique.all() and loads[2].unique.all()


def test_a_table_and_cards_have_the_same_figures(turned):
    loads = rx.spatial.body_loads(*turned)
    rows = list(csv.DictReader(as_csv(loads).splitlines()))
    assert [row["joint"] for row in rows] == ["hinge 1", "hinge 2", "(centre)", "pin", "(centre)"]
    np.testing.assert_allclose([float(rows[3][name]) for name in ("fx", "fy", "fz")], loads[3].force, rtol=1e-15)
    assert rows[0]["fx unique"] == "0" and rows[3]["fx unique"] == "1"
    cards = as_calculix(loads)
    line = next(line for line in cards.splitlines() if line.startswith("FLAP_PIN, 3,"))
    np.testing.assert_allclose(float(line.rpartition(",")[2]), loads[3].force[2], rtol=1e-8)
    assert "not determined by the rigid machine: degrees of freedom 1, 2, 3, 4, 5" in cards
    assert all(line.startswith("**") or line == "*CLOAD" or line.count(",") == 2 for line in cards.splitlines())


def test_the_command_writes_them(turned, tmp_path, capsys):
    (tmp_path / "door.py").write_text(
        "import jax.numpy as jnp\nimport redundax as rx\ndoor = rx.mechanisms.door(lean=0.0)\n"
        "state = rx.State(door.reference, jnp.zeros(6))\n"
    )
    for name in ("loads.inp", "loads.csv"):
        assert command.main(["audit", f"{tmp_path / 'door.py'}:door", "--loads", str(tmp_path / name)]) == 3
        assert (tmp_path / name).read_text().count("hinge") == 3
        assert "written:" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        command.main(["audit", "door.py:door", "--loads", "loads.txt"])


def test_planar_ones_are_refused():
    bar = rx.mechanisms.parallelogram()
    with pytest.raises(rx.RedundaxError, match="but is planar"):
        rx.spatial.body_loads(bar, bar.state(0.8), rx.solve(bar, bar.state(0.8, rate=jnp.ones(()))))
