"""What a user can read says the same physics in every unit: figures, verdicts, ranges, pages and pictures.

A figure of a kind is `factor` times as large in other units, and words are the same. The one exception is the minimum
norm in the units of a system, a convention that names itself.
"""

import contextlib
import dataclasses
import functools
import io
import re

import jax.numpy as jnp
import numpy as np
import pytest
import registry

import redundax as rx
from redundax.__main__ import main
from redundax._command._file import load
from redundax._solution_sets._family._preload import unit_free_norm
from redundax.plot._draw import draw

UNITS = {
    "mm, t": rx.units.Units(length=1e3, mass=1e-3),
    "inch": rx.units.Units(length=1 / 0.0254),
    "mrad": rx.units.Units(angle=1e3),
    "km, g, h": rx.units.Units(length=1e-3, mass=1e3, time=1 / 3600),
}
FAST = ("wojtyra2020 with friction",)
SLOW = ("armless", "bead", "pendulum", "door", "carriage", "massless", "parallelogram", "slider_crank with friction")
every_unit = pytest.mark.parametrize("unit", UNITS)
# Metres or inches take one way through the code: all other systems in two units, one of all kinds and one of angles.
every_system = pytest.mark.parametrize(
    ("name", "unit"),
    [
        *((name, unit) for name in FAST for unit in UNITS),
        *(pytest.param(name, unit, marks=pytest.mark.slow) for name in SLOW for unit in ("mrad", "km, g, h")),
    ],
)
PARTNERS = {"linear": "angular", "angular": "linear", "force": "moment", "moment": "force"}


def factor(kind, units):
    """How many new units a unit of this kind is."""
    force, moment = units.energy / units.length, units.energy / units.angle
    of_kind = {"linear": units.length, "angular": units.angle, "force": force, "moment": moment}[kind]
    return float(of_kind / (units.time**2 if kind in ("linear", "angular") else 1.0))


def assert_same(here, there, kinds, units, length, tolerance=1e-9):
    """Figures (..., kinds) of both units agree, beside the largest of their kind or of its partner at `length`."""
    kinds = np.array([kind.removeprefix("friction ") for kind in kinds])
    here, back = np.asarray(here), np.asarray(there) / [factor(kind, units) for kind in kinds]
    assert np.array_equal(np.isfinite(here), np.isfinite(back))
    largest = {kind: np.abs(here[..., kinds == kind]).max(initial=0.0) for kind in PARTNERS}
    arm = {"linear": length, "angular": 1 / length, "force": 1 / length, "moment": length}
    size = np.array([max(largest[kind], arm[kind] * largest[PARTNERS[kind]]) for kind in kinds])
    assert np.all(
        np.abs(here - back)[np.isfinite(here)] <= (tolerance * np.broadcast_to(size, here.shape))[np.isfinite(here)]
    )


@functools.cache
def armless():
    """A body guided twice at its centre of mass: only its masses have a length."""
    guides = [rx.Translational(name, "slide", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)) for name in "KL"]
    push = rx.AppliedForce("slide", (3.0, 1.0), moment=0.7)
    system = rx.Mechanism([rx.Body("slide", 1.0, 0.1)], guides, loads=[push], gravity=(0.0, -9.81))
    return system, rx.State([0.3, 0.0, 0.0], [1.0, 0.0, 0.0])


def both(name, unit):
    """A system and its state in its own units and in others."""
    case, units = None if name == "armless" else registry.case(name), UNITS[unit]
    system, state = (case.system, case.state) if case else armless()
    return (system, state), (rx.units.in_units(system, units), rx.units.state_in_units(state, system, units)), units


def kinds_of(system):
    slips = [kind for group in system.friction for kind in group.slips.kinds]
    friction = ["moment" if kind == "angular" else "force" for kind in slips]
    return [*system.coordinates.kinds, *system.rows.kinds, *friction]


def unit_free(system, state):
    return unit_free_norm(rx.factorize(system, state))


def rods(q, t, p):
    first, second = q[:2] - p, q[2:] - q[:2]
    return jnp.stack([first @ first - 1.0, second @ second - 1.0])


def weight(q, qd, t, p):
    return jnp.array([0.0, -9.81, 0.0, -9.81])


def two_on_rods(place, off):
    """Two point masses on rods of a metre from a given place, and a state whose rods are longer by a share."""
    system = rx.System(rods, jnp.ones(4), weight, jnp.asarray(place), m=2)
    ends = place + (1 + off) * np.cumsum([[0.8, -0.6], [0.28, -0.96]], axis=0)
    return system, rx.State(ends.ravel(), [0.6, 0.8, 0.6, 0.8])


# Figures ------------------------------------------------------------------------------------


@every_system
def test_solutions(name, unit):
    here, there, units = both(name, unit)
    one, other = (rx.solve(*at, closure=unit_free(*at), throw=False) for at in (here, there))
    assert one.result == other.result == rx.RESULTS.successful
    figures = (np.concatenate([s.acceleration, s.multipliers, s.friction]) for s in (one, other))
    assert_same(*figures, kinds_of(here[0]), units, float(rx.factorize(*here).length))


@every_system
def test_verdicts(name, unit):
    here, there, units = both(name, unit)
    one, other = (rx.analyze(*at, closure=unit_free(*at)) for at in (here, there))
    figures = {"singular_values", "gap", "tolerance", "self_stress", "spectral_radius", "releases", "verdicts"}
    figures |= {"length"}
    for field in {field.name for field in dataclasses.fields(one)} - figures:
        here_said, there_said = getattr(one, field), getattr(other, field)
        rounded = pytest.approx(there_said, rel=1e-6, abs=1e-9) if isinstance(there_said, float) else there_said
        assert here_said == rounded, field
    assert {**one.verdicts, "reaction": ()} == {**other.verdicts, "reaction": ()}  # which systems in other units lack
    assert one.pivots == other.pivots
    assert other.length == pytest.approx(one.length * float(units.length / units.angle), rel=1e-9)
    assert np.allclose(one.singular_values, other.singular_values, rtol=0, atol=1e-12)
    assert (one.spectral_radius is None) is (other.spectral_radius is None)
    assert (one.spectral_radius or 0.0) == pytest.approx(other.spectral_radius or 0.0, rel=1e-9)
    rows, length = here[0].rows, float(rx.factorize(*here).length)
    for pivot, state, turned in zip(one.pivots, one.self_stress, other.self_stress, strict=True):
        unit_of_pivot = factor(rows.kinds[rows.labels.index(pivot)], units)
        assert_same(state, turned * unit_of_pivot, rows.kinds, units, length)
    assert [freed(release) for release in one.releases] == [freed(release) for release in other.releases]


def freed(release):
    """The directions of a release and its measure, rounded."""
    shares = [(joint, {row: round(share, 7) for row, share in rows.items()}) for joint, rows in release.directions]
    return shares, round(release.determinant, 7)


@every_system
def test_default_ranges(name, unit):
    here, there, units = both(name, unit)
    for pivot in rx.analyze(*here).pivots[:2]:
        one, other = (rx.solution_family(*at, along=pivot, samples=5, closure=unit_free(*at)) for at in (here, there))
        assert (one.names, one.kinds, one.proved) == (other.names, other.kinds, other.proved)
        assert np.array_equal(one.count, other.count)
        kind = one.kinds[one.names.index(pivot)]
        assert np.allclose(other.axes[0], factor(kind, units) * one.axes[0], rtol=1e-9, atol=0)
        assert_same(one.values, other.values, one.kinds, units, float(rx.factorize(*here).length))


@pytest.mark.parametrize(("off", "accepted"), [(1e-5, False), (1e-7, True)])
@every_unit
def test_point_masses_are_measured_by_their_paths(unit, off, accepted):
    """They have no angle, but the radius of the rods: a state is as far off wherever it lies, in every unit."""
    units, found = UNITS[unit], []
    for place in (np.zeros(2), np.array([3.0, -7.0])):
        here = two_on_rods(place, off)
        there = rx.units.in_units(here[0], units), rx.units.state_in_units(here[1], here[0], units)
        found += [rx.solve(*at, throw=False) for at in (here, there)]
    results = {True: rx.RESULTS.successful, False: rx.RESULTS.violated_constraints}
    violations = [float(one.stats.violation.position) for one in found]
    assert all(one.result == results[accepted] for one in found)
    assert violations == pytest.approx([violations[0]] * 4, rel=1e-6)
    assert off / 2 < violations[0] < 10 * off


@pytest.mark.slow
def test_default_amplitude_of_the_minimum_norm_is_the_same_self_stress():
    """Of the minimum norm itself the amplitudes still are; what they are added to is not."""
    here, there, units = both("wojtyra2020 with friction", "mm, t")
    one, other = (rx.solution_family(*at, samples=5) for at in (here, there))
    assert "the minimum norm" in one.about == other.about
    assert np.allclose(other.axes[0], factor("force", units) * one.axes[0], rtol=1e-9, atol=0)


# Ranges of what bounds are known -----------------------------------------------------------


@pytest.mark.slow
@every_unit
def test_bands(unit):
    """A known preload in newtons is the same knowledge in other units."""
    here, there, units = both("wojtyra2020 with friction", unit)
    outputs = ["body 1.phi''", "B.x", "K.angle", "tau A"]
    limit = 30.0 * factor("force", units)
    one = rx.band(*here, outputs, rx.PreloadBox({"A.x": (-30.0, 20.0)}), samples=8)
    other = rx.band(*there, outputs, rx.PreloadBox({"A.x": (-limit, limit / 1.5)}), samples=8)
    assert np.array_equal(one.exact, other.exact)
    for end in ("lower", "upper"):
        assert_same(getattr(one, end), getattr(other, end), one.kinds, units, float(rx.factorize(*here).length), 1e-6)


# Commands and pictures ----------------------------------------------------------------------

PRESS = """
import redundax as rx

k, w = {length}, {mass}
guide = {{"normal": (1.0, 0.0), "guide_length": 0.08 * k, "friction": rx.Coulomb(0.1)}}
press = rx.Mechanism(
    [
        rx.Body("crank", 2.0 * w, 0.01 * w * k**2),
        rx.Body("rod", 1.5 * w, 0.02 * w * k**2),
        rx.Body("ram", 10.0 * w, 0.3 * w * k**2),
    ],
    [
        rx.Revolute("O", "crank", "ground", (-0.1 * k, 0.0), (0.0, 0.0)),
        rx.Revolute("P", "rod", "crank", (-0.25 * k, 0.0), (0.1 * k, 0.0)),
        rx.Revolute("Q", "ram", "rod", (0.0, 0.1 * k), (0.25 * k, 0.0)),
        rx.Translational("L", "ram", "ground", (-0.3 * k, 0.05 * k), (-0.3 * k, 0.0), **guide),
        rx.Translational("R", "ram", "ground", (0.3 * k, 0.0), (0.3 * k, 0.0), **guide),
    ],
    loads=[rx.AppliedForce("crank", moment=-5.0 * w * k**2)],
    gravity=(0.0, -9.81 * k),
)
guess = [0.0, 0.1 * k, 0.1 * k, -0.1 * k, 0.0, -0.5 * k, 0.8, -1.2, 0.0]
state = rx.assemble(press, guess, positions={{"crank.phi": 0.6}}, rates={{"crank.phi": -1.0}})
"""
PRESSES = {
    "m, kg": rx.units.Units(),
    "mm, t": UNITS["mm, t"],
    "inch, lb": rx.units.Units(length=1 / 0.0254, mass=1 / 0.45359237),
}
other_press = pytest.mark.parametrize("unit", ["mm, t", "inch, lb"])


@pytest.fixture(scope="module")
def press(tmp_path_factory):
    """The same press with guides at two heights, in a folder of its own for each unit."""
    folder = tmp_path_factory.mktemp("press")
    for unit, units in PRESSES.items():
        (folder / unit).mkdir()
        (folder / unit / "press.py").write_text(PRESS.format(length=float(units.length), mass=float(units.mass)))
    return folder


def command(*arguments):
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        assert main([str(argument) for argument in arguments]) == 0
    return out.getvalue()


def words(text):
    """Text without numbers and line ends, and without whether singular values that are dropped are zero or rounding."""
    plain = re.sub(r"(?<![\w.])[-+]?\d[\d.]*(e[-+]?\d+)?", "#", " ".join(text.split()))
    gap = "the smallest counted is # times the largest dropped, and a wide gap is a sure rank|# times any dropped"
    return re.sub(gap, "those dropped are zero", plain)


def length_of(folder, unit):
    return float(rx.factorize(*load(f"{folder / unit}/press.py:press")).length)


@other_press
@pytest.mark.slow
def test_study_of_a_file(press, unit):
    one, other = (command("study", f"{press / u}/press.py:press", "--samples", 5) for u in ("m, kg", unit))
    assert words(one) == words(other)
    assert "This assumes a preload as large as the largest joint load without friction" in words(one)
    length = length_of(press, "m, kg")
    for here, there in zip(families(one), families(other), strict=True):
        assert [name for name, *_ in here] == [name for name, *_ in there]
        kinds = [row[-1] for row in here]
        for column in (1, 2, 3):  # nearest 0, least, largest
            ends = ([float(row[column]) for row in rows] for rows in (here, there))
            assert_same(*ends, kinds, PRESSES[unit], length, 2e-5)


def families(text):
    """The rows of the table of each family: name, three numbers, verdict and kind."""
    row = re.compile(r"^(\S+(?: \S+)*) +(\S+) +(\S+) +(\S+)  (the same|varies) +(\w.*)$", re.MULTILINE)
    found = [row.findall(part) for part in text.split("Along the self-stress")[1:]]
    assert len(found) == 2 and all(len(rows) == 21 for rows in found)
    return found


def tables(page):
    """Every table of a page in Markdown that has a column of kinds, as (columns, rows of cells)."""
    found, head = [], None
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")] if line.startswith("|") else None
        if cells is None:
            head = None
        elif head is None:
            head = cells
            found.append((head, []))
        elif "---" not in line:
            found[-1][1].append(cells)
    return [table for table in found if table[0][-1] == "kind"]


def back(column, cells, rows, units):
    """The cell of a column in the units of the first press."""
    kind = cells[-1].removeprefix("friction ")
    number = float(cells[column])
    head, places = rows
    if head[column] in ("position", "velocity"):
        return number / (float(units.length) if kind == "linear" else 1.0)
    if head[column].startswith("state "):
        pivot = next(other[-1] for other in places if abs(float(other[column])) == 1.0)
        return number / factor(kind, units) * factor(pivot, units)
    return number / factor(kind, units)


@pytest.mark.slow
@other_press
def test_report_of_a_file(press, unit):
    pages = []
    for u in ("m, kg", unit):
        file = press / u / "page.md"
        command("report", f"{press / u}/press.py:press", "-o", file, "--samples", 5)
        pages.append(file.read_text(encoding="utf-8"))
    text = [words(page.partition("## How this report was made")[0]) for page in pages]
    assert text[0] == text[1]
    assert "It is no bound" in text[0]
    found = tables(pages[0]), tables(pages[1])
    assert [table[0][0] for table in found[0]] == [*["component"] * 4, "coordinate"]
    for one, other in zip(*found, strict=True):
        for here, there in zip(one[1], other[1], strict=True):
            for column in range(1, len(one[0]) - 1):
                assert (here[column] == "") is (there[column] == "")
                if here[column]:
                    size = max(abs(float(cells[column] or 0)) for cells in one[1] if cells[-1] == here[-1])
                    assert back(column, there, other, PRESSES[unit]) == pytest.approx(
                        float(here[column]), rel=2e-4, abs=1e-8 * size
                    )


def shapes(folder, unit, **options):
    """What `draw` draws but for texts, lines to them and the key with its round number: points of print by group."""
    from matplotlib import pyplot
    from matplotlib.patches import Polygon

    system, state = load(f"{folder / unit}/press.py:press")
    lam = rx.solve(system, state, closure=unit_free(system, state)).multipliers
    axes = draw(system, state, multipliers=lam, **options)
    on_paper = [
        (patch.get_gid(), axes.transData.transform(patch.get_xy()) * 72 / axes.figure.dpi)
        for patch in axes.findobj(Polygon)
        if not (patch.get_gid() or "").endswith("key")
    ]
    on_paper += [
        (None, axes.transData.transform(path.vertices) * 72 / axes.figure.dpi)
        for collection in axes.collections
        for path in collection.get_paths()
    ]
    pyplot.close(axes.figure)
    return on_paper


@other_press
@pytest.mark.parametrize("state", [0, 1])
@pytest.mark.slow
def test_pictures(press, unit, state):
    one, other = (shapes(press, u, self_stress=state) for u in ("m, kg", unit))
    assert [gid for gid, _ in one] == [gid for gid, _ in other]
    assert any("load force" in (gid or "") for gid, _ in one) and any("self-stress" in (gid or "") for gid, _ in one)
    for (gid, here), (_, there) in zip(one, other, strict=True):
        assert np.abs(here - there).max() < 1e-3, gid
