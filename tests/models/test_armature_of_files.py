"""Armature of joints between bodies that move, against MuJoCo's equations with loops as ideal constraints."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

mujoco = pytest.importorskip("mujoco")
support = pytest.importorskip("ideal_loops")

GEARED = """
<mujoco>
  <default><geom type="capsule" size="0.01"/></default>
  <worldbody>
    <body name="crank"><joint name="A" axis="0 1 0" armature="0.01"/><geom fromto="0 0 0 0 0 0.1"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B" axis="0 1 0" armature="0.02"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C" axis="0 1 0" armature="0.05"/><geom fromto="0 0 0 0 0 -0.2"/>
          <body name="tip" pos="0 0.1 -0.1"><joint name="T" axis="1 0.3 0.2" armature="0.03"/>
            <geom size="0.03 0.05 0.02" type="ellipsoid" pos="0.05 0 0.02"/></body></body>
      </body>
    </body>
    <body name="cart" pos="0 1 0"><joint name="X" type="slide" axis="0.2 1 0.3" armature="0.3"/>
      <geom type="sphere" size="0.05"/>
      <body name="turret" pos="0.1 0 0.2" euler="10 20 30"><joint name="U" axis="0.3 0.1 1" armature="0.2"/>
        <geom size="0.1 0.2 0.05" type="ellipsoid" pos="0 0.1 0"/>
        <body name="ram" pos="0.1 0 0.2"><joint name="S" type="slide" axis="1 0.5 0.2" armature="0.7"/>
          <geom size="0.1 0.2 0.05" type="ellipsoid" pos="0.1 0 0.1"/></body></body></body>
  </worldbody>
  <equality>
    <connect name="D" body1="rocker" body2="world" anchor="0 0 -0.2"/>
    <joint name="rack" joint1="S" joint2="U" polycoef="0 0.1 0 0 0"/>
  </equality>
</mujoco>
"""
BOB = """<body name="bob" pos="0.1 0.05 0"><joint name="K" type="ball" armature="0.04"/>
  <geom size="0.03 0.05 0.02" type="ellipsoid" pos="0.05 0 0.02"/></body>"""
NAMES = ("A.angle", "B.angle", "C.angle", "T.angle", "X.travel", "U.angle", "S.travel")


@pytest.fixture
def load(tmp_path):
    def loaded(text):
        (tmp_path / "geared.xml").write_text(text)
        return rx.load_model(tmp_path / "geared.xml")

    return loaded


@pytest.mark.slow
def test_armature_between_bodies_that_move_acts_as_in_mujoco_and_constrains_nothing(load):
    """Of hinges, slides and balls, in loops and outside, turning and coupled."""
    before, name, after = GEARED.partition('<body name="cart"')
    place = before.rindex("</body></body>")
    model = load(before[:place] + BOB + before[place:] + name + after)
    assert not any("armature" in note for note in model.notes)
    (positions, state), system = model.beside(1)[0], model.mechanism
    truth = support.IdealLoops(model.tree, positions)
    velocity = support.velocity_of_bodies(model.described.origin.model, truth.data, system.names.bodies)
    state = rx.State(state.q, jnp.asarray(velocity))
    solution = rx.solve(system, state)
    assert (len(system.names.bodies), int(solution.stats.redundancy), int(solution.stats.freedom)) == (8, 1, 7)
    joints = system.joint_coordinates.motion(state, solution.acceleration)
    order = [system.names.joint_coordinates.labels.index(name) for name in NAMES]
    theirs = [model.described.origin.model.joint(name.partition(".")[0]).dofadr[0] for name in NAMES]
    np.testing.assert_allclose(joints.rate[np.array(order)], truth.velocity[theirs], atol=1e-12)
    ours, expected = np.array([solution[f"{name}''"] for name in NAMES]), truth.accelerations()
    np.testing.assert_allclose(ours, expected[theirs], atol=1e-9 * np.abs(expected).max())
    energy = truth.velocity @ truth.mass @ truth.velocity
    np.testing.assert_allclose(state.qd @ system.mass(state.q, state.t) @ state.qd, energy, rtol=1e-12)


@pytest.mark.slow
def test_energy_stays_along_a_motion_with_armature(load):
    """With that of gravity, as MuJoCo counts both."""
    model = load(GEARED)
    rates = dict(zip(NAMES, support.IdealLoops(model.tree, model.positions, seed=3).velocity.tolist(), strict=True))
    start = rx.assemble(model.mechanism, model.state.q, rates=rates)
    motion = rx.simulate(model.mechanism, start, t1=0.3)
    assert motion.result == rx.RESULTS.successful
    theirs = model.described.origin.model
    theirs.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data, mass, energies = mujoco.MjData(theirs), np.zeros((theirs.nv, theirs.nv)), []
    for k in (0, len(motion.t) // 2, -1):
        data.qpos[:] = [motion[name][k] for name in NAMES]
        data.qvel[:] = [motion[f"{name}'"][k] for name in NAMES]
        mujoco.mj_forward(theirs, data)
        mujoco.mj_fullM(theirs, data, mass)
        energies.append(data.energy[0] + data.qvel @ mass @ data.qvel / 2)
    assert float(motion.stats.energy_error) < 1e-8
    np.testing.assert_allclose(energies, energies[0], atol=1e-8 * float(motion.stats.kinetic_energy))
