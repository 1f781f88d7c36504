"""Friction of feet that hold or are let go, by the conditions that it must meet."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from redundax._solvers._interior import interior
from redundax._system._directions import Directions
from redundax._tools._numbers import as_program

CORNERS = np.array([(0.5, 0.4), (-0.5, 0.4), (-0.5, -0.4), (0.5, -0.4)])  # m
MASS, SPIN, WEIGHT, HEIGHT, MU = 10.0, 1.5, 98.1, 0.5, 0.5


@pytest.mark.slow
def test_friction_is_found_about_the_push_at_which_a_foot_is_let_go():
    """Its multiplier and slack are both zero there, and slacks of the other feet far smaller than their multipliers."""
    slips = np.concatenate([[[1.0, 0.0, -y], [0.0, 1.0, x]] for x, y in CORNERS])
    matrix = slips @ (slips / np.array([MASS, MASS, SPIN])).T
    lean = np.stack([np.tile([HEIGHT / (4 * x), HEIGHT / (4 * y)], 4) for x, y in CORNERS])
    directions = Directions(jnp.ones(8), ((0, 1), (2, 3), (4, 5), (6, 7)))

    def limits(tau):
        most = jnp.repeat(MU * (WEIGHT / 4 - jnp.asarray(lean) @ tau) / jnp.sqrt(2.0), 2)  # of both slips of a foot
        return -most, most

    @jax.jit
    @jax.vmap
    def found(free):
        return interior(limits, free, jnp.asarray(matrix), jnp.zeros(8, bool), jnp.ones(8), directions)

    pulls = np.array([-1.3704717297812, -1.0756609505073, -17.476170496151])  # m/s^2, rad/s^2
    free = pulls @ slips.T * (1 - 5.812e-7 + np.linspace(-1e-7, 1e-7, 20001)[:, None])
    tau, well = found(jnp.asarray(free))
    assert np.all(well)
    most = np.sqrt(2) * np.asarray(jax.vmap(limits)(tau)[1])[:, ::2]
    alpha, tau = (np.asarray(x).reshape(-1, 4, 2) for x in (free + tau @ matrix, tau))
    slack, starts = most - np.linalg.norm(tau, axis=2), np.linalg.norm(alpha, axis=2)
    assert np.min(slack) > -1e-9 and np.max(np.minimum(slack, starts)) < 1e-8
    against = np.sum(alpha * tau, axis=2) + starts * np.linalg.norm(tau, axis=2)
    np.testing.assert_allclose(against, 0.0, atol=1e-8)
    np.testing.assert_allclose(slack[starts > 1e-3] / most[starts > 1e-3], 0.0, atol=1e-14)
    assert np.all(starts[:, [0, 2, 3]] > 1e-3) and np.ptp(np.sign(slack[:, 1] - 1e-9)) == 2  # it holds, and is let go


def test_friction_that_wedges_is_against_slips():
    """A plate on a table whose foot strikes a slope: loads that friction causes raise it by more than itself.

    There are several solutions. Numbers of one joint parted by rounding, and with them the ways of friction and slip.
    """
    gain = [
        [0.009944573679424674, 0.539970397701099, -5.13675146981188, 1.153185611446732, 1.651566797400942],
        [0.002840521513231971, 0.05476076958597816, -1.467237664326977, 0.3293905443972248, 0.212352235463388],
        [0.09993405219980445, 0.02498809546600852, -0.2377123573056892, 0.324316060570356, 0.1159812327336181],
        [0.0116150402036332, 0.6306733782913573, -5.999611120724146, 0.8778379617958657, 1.549312627224085],
    ]
    matrix = [
        [0.397988198967212, -0.095295030844316, 1.044814858942537, 0.207271279402288, -0.256062806362927],
        [-0.095295030844316, 0.280600824297476, 0.312150736571001, -0.174666863918972, 0.215783332271985],
        [1.044814858942537, 0.312150736571, 3.969531072596692, 0.271382832604262, -0.335266178294265],
        [0.207271279402288, -0.174666863918972, 0.271382832604262, 0.168595642634876, -0.208282949370221],
        [-0.256062806362927, 0.215783332271985, -0.335266178294265, -0.208282949370221, 0.257312622796005],
    ]
    free = np.array([1.399244886092343, -1.43415359632622, 2.851961774547941, 1.01111560192158, -1.809226849446199])
    pushes = np.array([0.445106600020015, 0.127138167386129, 0.020598103639021, 0.519874578920517])
    arms, joints = np.array([1.0, 1.0, 0.05, 1.0, 1.0]), ((0, 1, 2), (3, 4))
    gain, matrix, count = jnp.asarray(gain), jnp.asarray(matrix), jnp.array([3.0, 3.0, 3.0, 2.0, 2.0])

    def found(speed):
        def limits(tau):
            down, one, other, foot = speed * pushes + gain @ tau
            plate = 0.3526791554558053 * jnp.maximum(jnp.abs(down), 10 * jnp.hypot(one, other))
            most = arms * jnp.stack([plate, plate, plate, 0.3 * foot, 0.3 * foot]) / jnp.sqrt(count)
            return -most, most

        size = jnp.array([1.0, 1.0, 0.2289, 1.0, 1.0])
        slips = Directions(jnp.asarray(arms), joints)
        tau, well = interior(limits, speed * free, matrix, jnp.zeros(5, bool), 1 / size, slips)
        return tau, well, speed * free + matrix @ tau

    with np.errstate(all="ignore"):
        asked = [as_program(found)(np.float64(speed)) for speed in np.linspace(1.0, 1.5, 20)]
    tau, well, slip = (np.stack(x) for x in zip(*asked, strict=True))
    assert np.mean(well) > 0.5
    for joint in map(list, joints):
        force, rate = (tau / arms)[well][:, joint], (slip * arms)[well][:, joint]
        sizes = np.linalg.norm(force, axis=1) * np.linalg.norm(rate, axis=1)
        np.testing.assert_allclose(np.sum(force * rate, axis=1), -sizes, rtol=1e-9)
