"""Words and figures agree: what verdicts and the report say of outputs is what families, bands and tables show.

    unique      the same in every solution that is found, and its band has no width
    zero        no solution has any; only what a joint cannot carry is called so
    not unique  differs along each self-stress state that is said to move it; along the others it is the same as long
                as self-stress is no larger than loads
    no change   the same in every solution with self-stress no larger than loads

Solutions are those of `solution_family` and `band`. Rounding is measured against the largest of a kind, or against
1e-3 of the other kind, times or over a length of the mechanism.
"""

import jax
import numpy as np
import pytest
from fuzzing import fuzz
from fuzzing.library import mechanisms
from fuzzing.recipes import RECIPES
from fuzzing.samples import Scales, raw_numbers
from mechanisms import CASES, MORE
from registry import EVERYTHING, case

import redundax as rx
from redundax._analysis._outputs import outputs
from redundax.plot._page._blocks import Items, Table, Text
from redundax.plot._page._contents import contents

pytestmark = pytest.mark.filterwarnings("ignore:Argument `(misfit|W)` looks:UserWarning")
UNIQUE, ZERO, NO_CHANGE, NOT_UNIQUE, UNDECIDED = rx.Verdict
SAME, DIFFERS = 1e-11, 1e-8  # solutions are found to about 1e-13; between them neither is asked for
NEAR = np.array([-1.0, -0.3, 0.0, 0.3, 1.0])  # times the loads over the self-stress
FAR = np.array([-100.0, -30.0, -10.0, -3.0, -0.3, 0.0, 0.3, 3.0, 10.0, 30.0, 100.0])
OTHER = {"linear": "angular", "angular": "linear", "force": "moment", "moment": "force"}
FORCES = "force x", "force y"
CARRIED = {
    rx.Revolute: FORCES,
    rx.Fixed: (*FORCES, "moment"),
    rx.Translational: ("moment",),
    rx.spatial.Revolute: (*FORCES, "force z"),
}
NOT_CARRIED = {
    rx.Revolute: ("moment",),
    rx.PinInSlot: ("moment",),
    rx.DistanceDriver: ("moment",),
    rx.AngleDriver: FORCES,
    rx.AngleCoupling: FORCES,
}


def families(system, state, report, length):
    """Along each self-stress state a family as large as the loads, and one that turns the loads of joints around."""
    as_forces = np.where(system.rows.angular, 1 / length, 1.0)
    load = np.abs(rx.solve(system, state).multipliers * as_forces).max() or 1.0
    for pivot, stress in zip(report.pivots, report.self_stress, strict=True):
        scale = load / np.abs(stress * as_forces).max()
        yield tuple(rx.solution_family(system, state, along=pivot, z=scale * z, starts=4) for z in (NEAR, FAR))


def spreads(system, state, values, length) -> dict:
    """How far each output differs between solutions (solutions, n + m + p), relative to the size of its kind."""
    known = system.names.unknowns
    kinds = {name: kind.removeprefix("friction ") for name, kind in zip(known.labels, known.kinds, strict=True)}
    each = np.array([*kinds.values()])
    own = {kind: np.abs(values[:, each == kind]).max(initial=0.0) for kind in OTHER}
    lever = {"linear": length, "angular": 1 / length, "force": 1 / length, "moment": length}
    size = {kind: max(own[kind], 1e-3 * own[OTHER[kind]] * lever[kind]) or 1.0 for kind in OTHER}
    found = {}
    for names, matrix in outputs(system, state).values():
        for name, spread in zip(names, np.ptp(values @ matrix.T, axis=0), strict=True):
            found[name] = spread / size[kinds.get(name, "moment" if " moment on " in name else "force")]
    return found


def agrees(system, state, length=1.0) -> set:
    """Compare all words with all figures; the verdicts that were met."""
    report = rx.analyze(system, state)
    if report.problem or report.at_rest or report.singular_position or not report.redundancy:
        return set()
    judged = {one.name: one for group in report.verdicts.values() for one in group}
    for row, column in zip(report.rows, report.self_stress.T, strict=True):
        assert (judged[row].without_friction is UNIQUE) == (row in report.unique_multipliers) == (not column.any()), row
    if isinstance(system, rx.Mechanism):
        only_zero_what_cannot_be_carried(system, judged)
    found = list(families(system, state, report, length))
    for number, (near, far) in enumerate(found):
        moved = {name for name, one in judged.items() if number in one.moved_by}
        told = {name for name, one in judged.items() if one.with_friction is not UNDECIDED}
        sure = {name for name, one in judged.items() if one.with_friction in (UNIQUE, ZERO)}
        few, many = (spreads(system, state, family.values, length) for family in (near, far))
        assert {name: many[name] for name in moved & told if many[name] < DIFFERS} == {}
        assert {name: many[name] for name in sure if many[name] > SAME} == {}
        assert {name: few[name] for name in told - moved if few[name] > SAME} == {}
        words = {line.split("  ")[0].partition(",")[0] for line in str(near).splitlines() if "  varies  " in line}
        assert words & told <= moved
    bands_agree(system, state, judged, [near for near, _ in found], length)
    return {one.with_friction for one in judged.values()}


def only_zero_what_cannot_be_carried(mechanism, judged):
    stacks = zip(mechanism.joints, mechanism.names.joints, strict=True)
    for joint, kind in ((name, type(stack.element)) for stack, names in stacks for name in names):
        for part, _ in mechanism.frame.reaction:
            one = next(one for name, one in judged.items() if name.startswith(f"{joint} {part} on "))
            verdicts = {one.without_friction, one.with_friction}
            assert part not in NOT_CARRIED.get(kind, ()) or verdicts == {ZERO}, one
            assert part not in CARRIED.get(kind, ()) or ZERO not in verdicts, one


def bands_agree(system, state, judged, families, length):
    """The band over all self-stress states at once."""
    box = {family.along[0]: (family.axes[0][0], family.axes[0][-1]) for family in families}
    bands = rx.band(system, state, [*judged], rx.AmplitudeBox(box), samples=8, starts=1)
    ends = np.concatenate([bands.lower_solution, bands.upper_solution])
    width = spreads(system, state, ends, length)
    for name, low, high, exact in zip(bands.names, bands.lower, bands.upper, bands.exact, strict=True):
        verdict = judged[name].with_friction
        assert verdict not in (UNIQUE, ZERO) or (exact and low == high and width[name] < SAME), name
        assert verdict is not ZERO or low == 0, name
        assert verdict is not NO_CHANGE or width[name] < SAME, name
        assert verdict is not NOT_UNIQUE or (low < high and width[name] > DIFFERS), name


# The mechanisms of the findings ----------------------------------------------------------------------


def lift(angle=-5.8e-32):
    """A level platform on three cranks, the third by two pins in one slot; rounding has turned the platform."""
    names, places = ("left", "right", "third", "platform"), (-1.0, 1.0, 0.0)
    bodies = [rx.Body(name, 2.0, 0.5) for name in names]
    joints = [
        rx.Revolute(f"foot {name}", name, rx.GROUND, (-0.5, 0), (x, 0)) for name, x in zip(names, places, strict=False)
    ]
    joints += [
        rx.Revolute(f"head {name}", "platform", name, (x, 0), (0.5, 0))
        for name, x in zip(names[:2], places, strict=False)
    ]
    joints += [rx.PinInSlot(name, "third", "platform", (0.5, 0), (0, 0), (0, 1)) for name in ("slot", "copy")]
    c, s = np.cos(0.7), np.sin(0.7)
    q = [x for place in places for x in (place + c / 2, s / 2)] + [c, s, 0.7, 0.7, 0.7, angle]
    qd = [-s / 2, c / 2] * 3 + [-s, c, 1.0, 1.0, 1.0, 0.0]
    return rx.Mechanism(bodies, joints, gravity=(0.0, -9.81)), rx.State(q, qd)


def pendulum_on_two_pins():
    """A pin that is listed twice: at minimum norm both carry half, and friction is least."""
    body = rx.Body("rod", 2.0, 0.5)
    pins = [rx.Revolute(name, "rod", rx.GROUND, (-0.5, 0), (0, 0), 1.0, rx.Coulomb(0.05)) for name in "AB"]
    c, s = np.cos(-0.4), np.sin(-0.4)
    return rx.Mechanism([body], pins, gravity=(0.0, -9.81)), rx.State([c / 2, s / 2, -0.4], [-s / 2, c / 2, 1.0])


def wheels():
    """Two wheels whose angles are coupled twice."""
    bodies = [rx.Body(name, 2.0, 0.5) for name in ("pinion", "wheel")]
    joints = [rx.Revolute(f"pin {x}", body.name, rx.GROUND, (0, 0), (x, 0)) for x, body in enumerate(bodies)]
    joints += [rx.AngleCoupling(name, "pinion", "wheel", ratio=2.0) for name in ("mesh", "copy")]
    loads = [rx.AppliedForce("wheel", moment=3.0)]
    return rx.Mechanism(bodies, joints, loads=loads), rx.State([0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 2.0, -1.0])


def test_a_platform_that_rounding_turned_is_level():
    mechanism, state = lift()
    found = {one.name: one for one in rx.analyze(mechanism, state).verdicts["reaction"]}
    assert found["slot force x on third"].with_friction is ZERO
    assert found["slot force y on third"].with_friction is NOT_UNIQUE


def test_a_joint_listed_twice_is_looked_at_beyond_its_first_derivative():
    """Along the load the sizes of both halves, N/2 + z and N/2 - z, add up to N until z = N/2, and to 2 z beyond."""
    system, state = pendulum_on_two_pins()
    report = rx.analyze(system, state)
    load = np.asarray(rx.solve(system, state).multipliers).reshape(2, 2)
    np.testing.assert_allclose(load[0], load[1], rtol=1e-12)
    assert all(one.with_friction is NOT_UNIQUE for one in report.verdicts["acceleration"])
    assert all(one.moved_by == (0, 1) for one in report.verdicts["acceleration"])


# The law --------------------------------------------------------------------------------------------

SYSTEMS = {
    name: lambda name=name: (case(name).system, case(name).state) for name in EVERYTHING if "with friction" not in name
}
SYSTEMS |= {name: lambda one=one: (one.rubbing, one.state) for name, one in CASES.items() if name not in MORE}
SYSTEMS |= {"lift": lift, "pendulum on two pins": pendulum_on_two_pins, "wheels": wheels}
QUICK = ("lift", "slider_crank")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in SYSTEMS]
)
def test_words_and_figures_agree(name):
    agrees(*SYSTEMS[name]())


def random_agreement(recipe, number, samples) -> set:
    structure = fuzz.structure_of(recipe, number)
    raw = raw_numbers(
        structure, samples, np.random.default_rng([number, 7]), Scales(length=1.0, time=0.5, friction=0.1)
    )
    problem = fuzz.problem(structure, raw)
    batch, met = mechanisms(structure, problem.parameters), set()
    for k in range(samples):
        system = jax.tree.map(lambda x, k=k: x[k] if np.issubdtype(x.dtype, np.inexact) else x, batch)
        met |= agrees(system, jax.tree.map(lambda x, k=k: x[k], problem.state), raw["length"][k])
    return met


@pytest.mark.slow
@pytest.mark.parametrize("recipe", [recipe for recipe in RECIPES if recipe not in ("large", "many cranks")])
def test_words_and_figures_of_random_mechanisms_agree(recipe):
    wanted = {UNIQUE, ZERO, NOT_UNIQUE} if recipe in ("loop, doubled pin", "gears and frames") else {NOT_UNIQUE}
    assert random_agreement(recipe, 0, 3) >= wanted


# The report ------------------------------------------------------------------------------------------


def page_of(system, state):
    report = rx.analyze(system, state)
    families = [rx.solution_family(system, state, along=pivot, samples=5) for pivot in report.pivots]
    page = contents("", system, state, report, rx.solve(system, state), families, "minimum norm", "")
    return report, [block for section in page.sections for block in section.blocks]


@pytest.mark.parametrize("make", [wheels, lift, pytest.param(pendulum_on_two_pins, marks=pytest.mark.slow)])
def test_the_tables_of_a_report_agree(make):
    """Least and largest stand beside what is not unique and nothing else; the headline counts as the tables do.

    What a joint cannot carry has no row, and what is zero is counted apart.
    """
    _, blocks = page_of(*make())
    tables = [block for block in blocks if isinstance(block, Table)]
    headline = next(block for block in blocks if isinstance(block, Items)).items
    for words in (table for table in tables if table.head[0] == "verdict"):
        said = {name: word for word, names, _ in words.rows for name in names.split(", ")}
        figures = next(table for table in tables if table.head[0] == "component" and table.caption == words.caption)
        assert {name for name, *_ in figures.rows} == {name for name, word in said.items() if word != ZERO.value}
        for name, value, *ends, _ in figures.rows:
            least, largest = ends or ("", "")
            assert (least != largest) == (said[name] == NOT_UNIQUE.value), name
            if said[name] == UNIQUE.value and value == "0":
                said[name] = ZERO.value
        (short,) = [item for item in headline if item.startswith(f"{words.caption}: ")]
        counts = {word: [*said.values()].count(word) for word in said.values()}
        zeros = counts.pop(ZERO.value, 0)
        for word, count in counts.items():
            assert f" {count} {word}" in short
        assert (f"; {zeros} more " in short) == (zeros > 0 and counts != {})


def test_a_report_tells_why_a_load_has_no_value_at_a_singular_position():
    """Two equal cranks in line with their coupler: loads along the line grow without bound beside it."""
    cranks = rx.mechanisms.parallelogram(2)
    report, blocks = page_of(cranks, cranks.state(phi=0.0, rate=1.0))
    assert report.undetermined == ("A1.x", "A2.x", "B1.x", "B2.x")
    tables = [block for block in blocks if isinstance(block, Table) and block.head[0] == "verdict"]
    reasons = {verdict: why for table in tables for verdict, _, why in table.rows}
    assert "unbounded beside this singular position" in reasons["undecided"]
    assert not any("friction" in why for why in reasons.values())
    assert any(isinstance(block, Text) and "beside it there is no self-stress" in block.text for block in blocks)


def test_a_report_says_that_couplings_of_angles_leave_out_forces():
    report, blocks = page_of(*wheels())
    told = "Angles alone are coupled by mesh, copy: no force of teeth or belts loads the bearings. "
    told += "A `GearPair` has that of teeth."
    assert report.couplings == ("mesh", "copy")
    assert told in str(report)
    assert Text(told, warning=True) in blocks
    assert rx.analyze(*lift()).left_out == ""


@pytest.mark.slow
def test_a_report_says_that_teeth_pull():
    mechanism = rx.mechanisms.planetary(2, flank=-1)
    with pytest.warns(UserWarning, match="Teeth pull"):
        report, blocks = page_of(mechanism, mechanism.state(phi=0.4, rate=10.0))
    assert report.pulling == ("S1.teeth", "R1.teeth", "S2.teeth", "R2.teeth")
    assert any(isinstance(block, Text) and block.warning and "R2.teeth: their other" in block.text for block in blocks)
