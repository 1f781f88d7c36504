"""What friction of a large mechanism causes, X tau: one more right-hand side for each friction that is asked about.

X tau = response to E tau,   E tau the generalised force of friction, of which no matrix is formed
"""

from jaxtyping import Array, Float

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._linear_map import LinearMap
from ._kinematics import along_slips, slip_force
from ._response import AbstractFactorisation, AbstractPick, Response


def friction_response(
    system: AbstractSystem, state: State, factor: AbstractFactorisation, pick: AbstractPick | None
) -> LinearMap:
    """The map from friction forces to the response that a closure picks, or to one of many."""
    return LinearMap(_caused, (system, state, factor, pick))


def friction_forces(system: AbstractSystem, state: State) -> LinearMap:
    """The map from friction forces to generalised forces, E."""
    return LinearMap(slip_force, (system, state))


def slip_accelerations(system: AbstractSystem, state: State, unit: LinearMap) -> LinearMap:
    """The map from friction forces to the rates of slip rates that they cause, E^T times the accelerations."""
    return LinearMap(_slip_acceleration, (system, state, unit))


def _caused(
    system: AbstractSystem,
    state: State,
    factor: AbstractFactorisation,
    pick: AbstractPick | None,
    tau: Float[Array, " p"],
) -> Response:
    a, lam = factor.respond(slip_force(system, state, tau)[:, None])
    return Response(a[:, 0], (lam if pick is None else pick(lam))[:, 0])


def _slip_acceleration(system: AbstractSystem, state: State, unit: LinearMap, tau: Array) -> Float[Array, " p"]:
    return along_slips(system, state, (unit @ tau).acceleration)
