"""Models of real machines against figures that two computations outside of the package agree on."""

import itertools
import json
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._models._audit import audit

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("yaml")

FOLDER = pathlib.Path(__file__).parents[3] / "shared" / "models"
FILES = {
    "fourbar": "fourbar.xml",
    "door": "door.urdf",
    "robotiq_2f85": "robotiq_2f85.xml",
    "robot_delta": "robot_delta.urdf",
    "5bar_linkage_iso3d": "5bar_linkage_iso3d.urdf",
    "digit_like_2legs": "digit_like_2legs.urdf",
}
OTHER_NAMES = {"connect foot ~ D": "pin_D"}
BALL = {"urdf": [3, 0, 1, 2], "xml": [0, 1, 2, 3]}  # where w, x, y and z stand

pytestmark = pytest.mark.skipif(not (FOLDER / "expected.json").is_file(), reason="the models are not here")
models = pytest.mark.parametrize("name", FILES)


@pytest.fixture(scope="module")
def expected():
    return json.loads((FOLDER / "expected.json").read_text())["models"]


@pytest.fixture(scope="module")
def loaded():
    return {name: rx.load_model(FOLDER / file) for name, file in FILES.items()}


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
def test_counts(name, expected, loaded):
    known, model = expected[name], loaded[name]
    assert len(model.mechanism.names.bodies) == known["bodies_in_count"]
    assert {kind: len(names) for kind, names in model.joints.items()} == {k: n for k, n in known["joints"].items() if n}
    assert {kind: len(names) for kind, names in model.loops.items()} == {
        k: n for k, n in known["closures"].items() if n
    }
    assert len(model.mechanism.rows) == known["neutral"]["rows"]


@models
def test_redundancy_and_freedom_at_every_position(name, expected, loaded):
    known, model = expected[name], loaded[name]
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
def test_unique_dimensions_elsewhere_and_joints_replaced_by_freer_ones(name, expected, loaded):
    known, model = expected[name], loaded[name]
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
    for change, (redundancy, freedom) in known["neutral"]["replacements"].items():
        part, _, by = change.rpartition(" -> ")
        own = members[OTHER_NAMES.get(part, part)]
        out = [k for k in own if by == "removed" or rows[k].rpartition(".")[2] in FREED[by]]
        assert out
        rank = np.linalg.matrix_rank(found.here.stress[np.ix_(out, out)], tol=1e-6, hermitian=True)
        assert (found.here.redundancy - rank, found.here.freedom + len(out) - rank) == (redundancy, freedom), change


@pytest.mark.parametrize("name", ["fourbar", "robotiq_2f85"])
def test_all_smallest_sets_of_releases(name, expected, loaded):
    """Of rows along the axes of the stated figures, at the file's own position; a set is regular on self-stress."""
    known, model = expected[name]["neutral"], loaded[name]
    look, rows = audit(model.mechanism, model.state, []).here, list(model.mechanism.rows.labels)
    basis = np.linalg.eigh(look.stress)[1][:, -look.redundancy :]
    anchors = model.tree.at(model.tree.model.qpos0)
    joints = {link.name: link.joint for link in model.plan.links}
    theirs = {}
    for part, about in known["parts"].items():
        own = OTHER_NAMES.get(part, part)
        if about["kind"] != "hinge":
            for word, row in (("force_x", "radial_1"), ("force_y", "radial_2"), ("force_z", "axial")):
                if f"{own}.{row}" in rows:
                    theirs[f"{part}.{word}"] = basis[rows.index(f"{own}.{row}")]
            continue
        theirs[f"{part}.axial"] = basis[rows.index(f"{own}.axial")]
        axes = np.asarray(rx.spatial.Placement(anchors.xanchor[joints[own]], anchors.xaxis[joints[own]]).axes)
        for side in "uv":
            along = axes.T @ about["frame"][f"radial_{side}"]
            for word, row in (("radial", "radial"), ("tilt", "bend")):
                pair = [basis[rows.index(f"{own}.{row}_{k}")] for k in (1, 2)]
                theirs[f"{part}.{word}_{side}"] = along[0] * pair[0] + along[1] * pair[1]
    found = [
        each
        for each in itertools.combinations(theirs, look.redundancy)
        if abs(np.linalg.det([theirs[row] for row in each])) > 1e-6
    ]
    assert len(found) == known["releases"]["number_of_minimal_sets"]
    assert {row for each in found for row in each} == set(known["releases"]["rows_in_any_set"])
    listed = known["releases"].get("all_minimal_sets") or []
    assert not listed or sorted(map(sorted, listed)) == sorted(map(sorted, found))


@models
def test_the_closed_state_of_the_file_and_positions_beside_agree(name, expected, loaded):
    model = loaded[name]
    found = audit(model.mechanism, model.state, model.elsewhere(2))
    known = expected[name]["neutral"]
    assert found.is_decided
    assert len(found.others) == 2
    assert found.figures == (known["redundancy"], known["freedom"])


@pytest.mark.parametrize("name", ["fourbar", "robotiq_2f85"])
def test_releases_leave_no_redundancy_and_the_same_freedom(name, loaded):
    model = loaded[name]
    found, names = audit(model.mechanism, model.state, []), list(model.mechanism.rows.labels)
    jacobian = np.asarray(model.mechanism.jacobian(model.state.q, model.state.t))
    for group in found.groups:
        assert group.releases
        for release in group.releases:
            out = [names.index(row) for _, shares in release.directions for row in shares]
            assert len(out) == group.redundancy
            rest = np.delete(jacobian, out, axis=0)
            assert np.linalg.matrix_rank(rest, tol=1e-9) == found.here.rank


class Dependent:
    """Redundancy and parts of a dependent group."""

    def __init__(self, group):
        self.redundancy, self.parts = group.redundancy, {row.rpartition(".")[0] for row in group.rows}


WEIGHTS = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # of central differences of eighth order
STEP = 1e-3


@pytest.mark.parametrize("name", ["fourbar", "robotiq_2f85", "robot_delta"])
def test_accelerations_and_drive_forces_are_those_of_mujoco_with_ideal_loops(name):
    """N^T M N z = -N^T (c + M p), qdd = p + N z with the null space N of the loops in the joint coordinates of MuJoCo.

    Joints on the spin of a part between two hinges on one axis have accelerations of rounding and are left out.
    """
    model = rx.load_model(FOLDER / FILES[name])
    tree, positions = model.tree, model.positions
    theirs, slopes = tree.model, lambda at: tree.system(at)[1]
    theirs.opt.disableflags |= sum(
        getattr(mujoco.mjtDisableBit, f"mjDSBL_{word}") for word in ("CONTACT", "EQUALITY", "LIMIT", "ACTUATION")
    )
    for bound in (theirs.body_mass, theirs.body_inertia):
        bound[bound < 3e-14] = 0.0
    motion = np.linalg.svd(slopes(positions))[2][np.linalg.matrix_rank(slopes(positions), tol=1e-9) :].T
    velocity = motion @ np.random.default_rng(0).normal(size=motion.shape[1])
    along = [
        weight
        * (slopes(tree.moved(positions, k * STEP * velocity)) - slopes(tree.moved(positions, -k * STEP * velocity)))
        for k, weight in WEIGHTS
    ]
    data, mass = mujoco.MjData(theirs), np.zeros((theirs.nv, theirs.nv))
    data.qpos[:], data.qvel[:] = positions, velocity
    mujoco.mj_forward(theirs, data)
    mujoco.mj_fullM(theirs, data, mass)
    prescribed = -np.linalg.lstsq(slopes(positions), sum(along) @ velocity / STEP, rcond=1e-9)[0]
    inert, passive = motion.T @ mass @ motion, data.qfrc_passive - data.qfrc_bias - mass @ prescribed

    def ideal(applied):
        return prescribed + motion @ np.linalg.solve(inert, motion.T @ (passive + applied))

    names = [theirs.joint(k).name for k in range(theirs.njnt)]
    rates = {f"{joint}.angle": float(velocity[k]) for k, joint in enumerate(names)}
    state = rx.assemble(model.mechanism, model.state.q, rates=rates)
    solution = rx.solve(model.mechanism, state)
    judged = [k for k, joint in enumerate(names) if not joint.startswith("closedloop")]
    ours, expected = np.array([float(solution[f"{names[k]}.angle''"]) for k in judged]), ideal(0.0)[judged]
    np.testing.assert_allclose(ours, expected, atol=1e-9 * np.abs(ideal(0.0)).max())
    drives = tree.drives(positions)[1] if theirs.nu else np.eye(theirs.nv)[:1]
    wanted = np.random.default_rng(1).normal(size=len(drives)) * np.abs(passive).max()
    found = drive_forces(model.mechanism, state, ideal(drives.T @ wanted)[judged] - ours, judged, drives, names)
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
