"""Models of real machines against figures that two computations outside of the package agree on."""

import itertools
import json
import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._bodies._space._rotation import rotation
from redundax._models._audit import audit

pytest.importorskip("mujoco")
pytest.importorskip("yaml")
IdealLoops = pytest.importorskip("ideal_loops").IdealLoops

FOLDER = pathlib.Path(__file__).parents[1] / "support" / "models"  # its README.md says where they are from
FILES = {
    "fourbar": "fourbar.xml",
    "door": "door.urdf",
    "robotiq_2f85": "robotiq_2f85.xml",
    "robot_delta": "robot_delta.urdf",
    "5bar_linkage_iso3d": "5bar_linkage_iso3d.urdf",
}
OTHER_NAMES = {"connect foot ~ D": "pin_D"}
BALL = {"urdf": [3, 0, 1, 2], "xml": [0, 1, 2, 3]}  # where w, x, y and z stand

LARGER = ("robotiq_2f85", "robot_delta")


def each(*names):
    """A test of these models, of the larger ones in the slow run."""
    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=pytest.mark.slow if name in LARGER else ()) for name in names]
    )


models = each(*FILES)


@pytest.fixture(scope="module")
def expected():
    return json.loads((FOLDER / "expected.json").read_text())


def model_of(name):
    return rx.load_model(FOLDER / FILES[name])


def positions_of(known, q, suffix):
    positions, place = {}, 0
    for coordinate in known["coordinates"]:
        size = coordinate.get("numbers", 1)
        value = np.array(q[place : place + size])
        positions[coordinate["joint"]] = value[BALL[suffix]] if size == 4 else value
        place += size
    assert place == len(q)
    return positions


def state_at(model, known, q, suffix):
    guess = model.guess(positions_of(known, q, suffix))
    assert float(jnp.max(jnp.abs(model.mechanism.constraint(guess, jnp.zeros(()))))) < 1e-12
    return rx.State(guess, jnp.zeros(len(model.mechanism.coordinates)))


@models
def test_counts(name, expected):
    known, model = expected[name], model_of(name)
    assert len(model.mechanism.names.bodies) == known["bodies_in_count"]
    assert {kind: len(names) for kind, names in model.joints.items()} == known["joints"]
    assert {kind: len(names) for kind, names in model.loops.items()} == known["closures"]
    assert len(model.mechanism.rows) == known["neutral"]["rows"]


@models
def test_redundancy_and_freedom_at_every_position(name, expected):
    known, model = expected[name], model_of(name)
    looks, (found, _) = [known["neutral"], *known["other_configurations"]], looks_at(known, model, name)
    assert found.is_decided
    assert [each.figures for each in (found.here, *found.others)] == [
        (look["redundancy"], look["freedom"]) for look in looks
    ]
    assert sorted((g.redundancy, len(g.parts)) for g in map(Dependent, found.groups)) == sorted(
        (group["redundancy"], len(group["parts"])) for group in known["neutral"].get("dependent_groups", ())
    )
    parts = {part.name: part for part in found.parts}
    for part, about in known["neutral"]["parts"].items():
        own, wanted = parts[OTHER_NAMES.get(part, part)], about["unique_dimensions"]
        assert own.force == wanted.get("force", [0, 0]), part
        assert own.moment == wanted.get("moment", own.moment), part
        if "axial" in about["unique"]:
            assert ("axial" not in own.loose) == about["unique"]["axial"], part
    whole = {OTHER_NAMES.get(part, part) for part in known["neutral"]["fully_unique_parts"]}
    assert {part.name for part in found.parts if not part.loose} == whole


def looks_at(known, model, name):
    """The audit at the neutral position, and its looks at the others."""
    suffix, looks = FILES[name].rpartition(".")[2], [known["neutral"], *known["other_configurations"]]
    states = [state_at(model, known, look["q"], suffix) for look in looks]
    found = audit(model.mechanism, states[0], states[1:])
    return found, (found.here, *found.others)


FREED = {"cylindrical": ("axial",), "spherical": ("bend_1", "bend_2", "twist")}
FREED |= {"spherical_sliding": (*FREED["cylindrical"], *FREED["spherical"])}


@models
def test_unique_dimensions_elsewhere_and_joints_replaced_by_freer_ones(name, expected):
    known, model = expected[name], model_of(name)
    found, looks = looks_at(known, model, name)
    rows, kinds = model.mechanism.rows.labels, model.mechanism.rows.kinds
    members = {}
    for k, row in enumerate(rows):
        members.setdefault(row.rpartition(".")[0], []).append(k)
    for part, about in known["neutral"]["parts"].items():
        wanted, own = about["unique_dimensions"], members[OTHER_NAMES.get(part, part)]
        for look in looks:
            for kind in wanted.keys() & {"force", "moment"}:
                assert look.dimensions([k for k in own if kinds[k] == kind]) == wanted[kind], (part, kind)
            if "radial_plane" in wanted:
                assert look.dimensions([k for k in own if ".radial_" in rows[k]]) == wanted["radial_plane"], part
            if "axial" in about["unique"]:
                (along,) = (k for k in own if rows[k].endswith(".axial"))
                assert look.unique[along] == about["unique"]["axial"], part
            assert all(look.unique[own]) == (part in known["neutral"]["fully_unique_parts"]), part
    for change, (redundancy, freedom) in known["neutral"]["replacements"].items():
        part, _, by = change.rpartition(" -> ")
        own = members[OTHER_NAMES.get(part, part)]
        out = [k for k in own if by == "removed" or rows[k].rpartition(".")[2] in FREED[by]]
        assert out
        rank = np.linalg.matrix_rank(found.here.stress[np.ix_(out, out)], tol=1e-6, hermitian=True)
        assert (found.here.redundancy - rank, found.here.freedom + len(out) - rank) == (redundancy, freedom), change


redundant_models = each("fourbar", "door", *LARGER)


def stated_rows(model, state, parts, stress):
    """Rows of self-stress along the axes of the stated figures, by their names, of those along the axes here.

    The direction of a row is that of a velocity of one of its bodies which the row forbids.
    """
    rows, bodies = model.mechanism.rows, len(model.mechanism.names.bodies)
    velocities = jacobian_at(model.mechanism, state).reshape(len(rows), 2, bodies, 3)
    turns, found = np.asarray(jax.vmap(rotation)(state.q[3 * bodies :].reshape(-1, 4))), {}
    for part, about in parts.items():
        own = [k for k, row in enumerate(rows.labels) if row.rpartition(".")[0] == OTHER_NAMES.get(part, part)]
        for word in about["unique"]:
            if about["kind"] == "coupling":
                found[f"{part}.{word}"] = stress[own[0]]
                continue
            is_moment = word.startswith(("tilt", "moment"))
            along = about["frame"][word.replace("tilt", "radial").replace("moment", "force")]
            shares = np.zeros(len(rows))
            for k in own:
                if rows.kinds[k] == ("moment" if is_moment else "force"):
                    body = np.argmax(np.linalg.norm(velocities[k, 1 if is_moment else 0], axis=-1))
                    axis = turns[body] @ velocities[k, 1, body] if is_moment else velocities[k, 0, body]
                    shares[k] = axis @ along
            np.testing.assert_allclose(np.linalg.norm(shares), 1, atol=1e-7)
            found[f"{part}.{word}"] = shares @ stress
    return found


@redundant_models
def test_rows_that_can_be_freed(name, expected):
    """A set of rows can be freed iff their self-stress is regular; the sets are counted where that is done."""
    known, model = expected[name]["neutral"], model_of(name)
    state = state_at(model, expected[name], known["q"], FILES[name].rpartition(".")[2])
    look, freed = audit(model.mechanism, state, []).here, known["releases"]
    basis = np.linalg.eigh(look.stress)[1][:, -look.redundancy :]
    theirs = stated_rows(model, state, known["parts"], basis)
    assert {row for row, share in theirs.items() if np.linalg.norm(share) > 1e-6} == set(freed["rows_in_any_set"])
    assert abs(np.linalg.det([theirs[row] for row in freed["one_minimal_set"]])) > 1e-9
    if "number_of_minimal_sets" not in freed:
        return
    found = [
        each
        for each in itertools.combinations(theirs, look.redundancy)
        if abs(np.linalg.det([theirs[row] for row in each])) > 1e-6
    ]
    assert len(found) == freed["number_of_minimal_sets"]
    listed = freed.get("all_minimal_sets") or []
    assert not listed or sorted(map(sorted, listed)) == sorted(map(sorted, found))


@models
def test_the_closed_state_of_the_file_and_positions_beside_agree(name, expected):
    model = model_of(name)
    found = audit(model.mechanism, model.state, model.elsewhere(2))
    known = expected[name]["neutral"]
    assert found.is_decided
    assert len(found.others) == 2
    assert found.figures == (known["redundancy"], known["freedom"])


@redundant_models
def test_releases_leave_no_redundancy_and_the_same_freedom(name, expected):
    """At the neutral position and at the others, each dependent group freed by itself."""
    known, model = expected[name], model_of(name)
    names, suffix = list(model.mechanism.rows.labels), FILES[name].rpartition(".")[2]
    for look in (known["neutral"], *known["other_configurations"]):
        state = state_at(model, known, look["q"], suffix)
        found, jacobian = audit(model.mechanism, state, []), jacobian_at(model.mechanism, state)
        assert sum(group.redundancy for group in found.groups) == look["redundancy"]
        for group in found.groups:
            assert group.releases
            for release in group.releases:
                out = [names.index(row) for _, shares in release.directions for row in shares]
                assert len(out) == group.redundancy
                assert np.linalg.matrix_rank(np.delete(jacobian, out, axis=0), tol=1e-9) == look["rank"]


def jacobian_at(mechanism, state):
    return np.asarray(eqx.filter_jit(lambda system: system.jacobian(state.q, state.t))(mechanism))


class Dependent:
    """Redundancy and parts of a dependent group."""

    def __init__(self, group):
        self.redundancy, self.parts = group.redundancy, {row.rpartition(".")[0] for row in group.rows}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fourbar", *LARGER])
def test_accelerations_and_drive_forces_are_those_of_mujoco_with_ideal_loops(name):
    """Joints on the spin of a part between two hinges on one axis have accelerations of rounding and are left out."""
    model = rx.load_model(FOLDER / FILES[name])
    tree, positions, theirs = model.tree, model.positions, model.described.origin.model
    truth = IdealLoops(tree, positions)
    velocity = truth.velocity
    names = [theirs.joint(k).name for k in range(theirs.njnt)]
    rates = {f"{joint}.angle": float(velocity[k]) for k, joint in enumerate(names)}
    state = rx.assemble(model.mechanism, model.state.q, rates=rates)
    solution = rx.solve(model.mechanism, state)
    judged = [k for k, joint in enumerate(names) if not joint.startswith("closedloop")]
    ours, expected = np.array([float(solution[f"{names[k]}.angle''"]) for k in judged]), truth.accelerations()
    np.testing.assert_allclose(ours, expected[judged], atol=1e-9 * np.abs(expected).max())
    drives = tree.drives(positions)[1] if theirs.nu else np.eye(theirs.nv)[:1]
    wanted = np.random.default_rng(1).normal(size=len(drives)) * np.abs(truth.passive).max()
    more = truth.accelerations(drives.T @ wanted)[judged] - ours
    found = drive_forces(model.mechanism, state, more, judged, drives, names)
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def drive_forces(system, state, more, judged, drives, names):
    """What drives give for `more` acceleration of the judged joints: N^T D^T u = N^T M N z, C N z = more."""
    columns = jnp.eye(len(system.coordinates))
    slopes = jax.vmap(lambda v: system.joint_coordinates.motion(rx.State(state.q, v), 0 * v).rate, out_axes=1)(columns)
    labels = system.names.joint_coordinates.labels
    slopes = np.asarray(slopes)[[labels.index(f"{name}.angle") for name in names]]
    jacobian = np.asarray(system.jacobian(state.q, state.t))
    rank = np.linalg.matrix_rank(jacobian, tol=1e-9)
    motion = np.linalg.svd(jacobian)[2][rank:].T
    z = np.linalg.lstsq(slopes[judged] @ motion, more, rcond=1e-9)[0]
    force = motion.T @ np.asarray(system.mass(state.q, state.t)) @ motion @ z
    return np.linalg.lstsq((drives @ slopes @ motion).T, force, rcond=1e-9)[0]
