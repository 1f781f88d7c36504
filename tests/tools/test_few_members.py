"""Where compiling must take little time members are chosen and added by products: XLA makes loops of gathers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._bodies._stack import Stack
from redundax._tools._compilation import in_little_time
from redundax._tools._module import tree_add, tree_pick

RANDOM = np.random.default_rng(3)
MEMBERS = np.array([2, 0, 2, 1, 3], np.int32)


@pytest.fixture(params=[False, True], ids=["gathers", "products"])
def quick(request):
    with in_little_time(request.param):
        yield request.param


@pytest.mark.parametrize("shape", [(4,), (4, 3), (4, 3, 3)])
def test_members_are_those_of_numpy(quick, shape):
    table = RANDOM.normal(size=shape)
    np.testing.assert_array_equal(tree_pick(jnp.asarray(table), jnp.asarray(MEMBERS)), table[MEMBERS])


def test_parts_of_members_add_up_as_in_numpy(quick):
    totals, parts = RANDOM.normal(size=(5, 3)), RANDOM.normal(size=(5, 3))
    wanted = totals.copy()
    np.add.at(wanted, MEMBERS, parts)
    found = tree_add(jnp.asarray(totals), jnp.asarray(MEMBERS), jnp.asarray(parts))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=4e-16 * 8)


def test_slopes_by_bodies_stand_at_both_bodies_and_not_at_the_ground(quick):
    i, j, count = np.array([0, 1, 3], np.int32), np.array([3, 0, 2], np.int32), 3
    slopes = RANDOM.normal(size=(3, 2, 6))
    wanted = np.zeros((3, 2, 3, count + 1))
    for joint in range(3):
        wanted[joint, :, :, i[joint]] += slopes[joint, :, :3]
        wanted[joint, :, :, j[joint]] += slopes[joint, :, 3:]
    found = Stack((), jnp.asarray(i), jnp.asarray(j)).by_bodies(jnp.asarray(slopes), count)
    np.testing.assert_array_equal(found, wanted[..., :count])


@pytest.mark.parametrize("make", [rx.mechanisms.wojtyra2020, rx.mechanisms.bricard])
def test_no_loop_stands_in_what_a_step_asks_of_a_model(make):
    """Gathers and scatters become loops, whose turns cost microseconds each, and 30 instructions."""
    mechanism = make()
    state = rx.assemble(mechanism) if make is rx.mechanisms.bricard else mechanism.state(phi=0.8, rate=1.0)

    def asked(q, qd, t):
        at = rx.State(q, qd, t)
        return mechanism.jacobian(q, t), mechanism.constraint(q, t), mechanism.load(at)

    with in_little_time(True):
        told = str(jax.make_jaxpr(asked)(state.q, state.qd, state.t))
    assert " gather[" not in told
    assert "scatter" not in told
