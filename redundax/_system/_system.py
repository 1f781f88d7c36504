"""The system layer: all that the solvers know of a mechanism.

    M(q, t) qdd + Phi_q^T lam = Q(q, qd, t) + F(lam, q, qd),   Phi(q, t) = 0          (2), (25)

The constraint force on the system is -Phi_q^T lam. Jacobians are taken through the retraction
q [+] d, addition unless said: Phi_q is the derivative of Phi(q [+] d, t) at d = 0. So velocities have n
entries while the chart q may have more.

Some rows may constrain velocities alone, A(q, t) qd = b(q, t), as those of wheels. They stand among the others: in
Phi they are zero whatever the position, in Phi_q they are A, in Phi_q qd + Phi_t they are A qd - b, and in gamma
-A' qd + b'. So all of (3), (5) and (7) holds of them, and (2) says nothing of them.
"""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Self, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, PyTree

from .._sparse._symbolic import Symbolic
from .._tools._errors import RedundaxError
from .._tools._functions import as_functions
from .._tools._module import (
    Numbers,
    as_float,
    as_parameters,
    check_kind,
    check_takes,
    check_whole,
    finite,
    is_concrete,
    moved,
    names_in,
    one_number,
    positive,
    replace_fields,
)
from .._tools._numbers import asked_of_model
from .._tools._table import are_known, page
from .._tools._value import AbstractModel, found_once
from ._axis import Axis, axis
from ._friction import AbstractFriction, slip_kinds
from ._joint_coordinates import AbstractJointCoordinates, NoJointCoordinates, joint_motion
from ._names import Names, index_of
from ._pages import notes, values_of
from ._state import State
from ._units import StatedUnits, Units, stated
from ._velocity_constraints import no_positions, rows_of_velocity


class Path(NamedTuple):
    """q', the field d/dr (q [+] r qd) at r = 0; poses of bodies, their rates, and the rates of these along it."""

    chart: Float[Array, "..."]
    poses: PyTree
    rate: PyTree
    bend: PyTree


class AbstractSystem(AbstractModel):
    """Mass, constraints, load and friction of a constrained system, with the names and kinds of its axes."""

    _names: eqx.AbstractVar[Names]
    friction: eqx.AbstractVar[tuple[AbstractFriction, ...]]

    @found_once
    def names(self) -> Names:
        """Names and kinds of all, those of slips from the friction."""
        return self._names.with_slips(self.slips)

    @property
    def coordinates(self) -> Axis:
        """Names and kinds of coordinates and velocities."""
        return self._names.coordinates

    @property
    def rows(self) -> Axis:
        """Names and kinds of constraint rows and multipliers."""
        return self._names.rows

    @property
    def slips(self) -> Axis:
        """Names and kinds of the slips of all friction groups."""
        return slip_kinds(self.friction)

    @property
    def undriven(self) -> "AbstractSystem":
        """The same without the rows that laws of drives add behind its own."""
        return self

    @property
    def radian(self) -> ArrayLike:
        """One radian in the unit of the angular coordinates, which are in radians unless a system says otherwise."""
        return 1.0

    @property
    def length(self) -> ArrayLike:
        """Its size where it has no angles and its rows are straight, so that these tell none."""
        return 1.0

    @property
    def has_length(self) -> bool:
        """Whether that is declared, so that no curvature of its rows counts."""
        return False

    @property
    @abc.abstractmethod
    def constant_mass(self) -> bool:
        """Whether `mass` depends on neither position nor time."""

    @property
    def diagonal_mass(self) -> bool:
        """Whether `mass` is known to be diagonal."""
        return False

    @abc.abstractmethod
    def mass(self, q: Float[Array, "..."], t: Float[Array, ""]) -> Float[Array, "n n"]:
        """Mass matrix, symmetric positive semidefinite."""

    def kinetic_energy(self, q: Float[Array, "..."], qd: Float[Array, " n"], t: Float[Array, ""]) -> Float[Array, ""]:
        """T = qd^T M qd / 2."""
        return qd @ self.mass(q, t) @ qd / 2

    @abc.abstractmethod
    def constraint(self, q: Float[Array, "..."], t: Float[Array, ""]) -> Float[Array, " m"]:
        """Constraint residual Phi(q, t), Eq. (2)."""

    @asked_of_model
    def jacobian(self, q: Float[Array, "..."], t: Float[Array, ""]) -> Float[Array, "m n"]:
        """Constraint Jacobian Phi_q through the retraction, A in rows of velocity; whoever overrides it says the same
        as `constraint` and `velocity_constraint`."""
        zero = jnp.zeros(len(self.coordinates), q.dtype)
        slopes = jax.jacfwd(lambda d: self.constraint(self.retract(q, d), t))(zero)
        return (
            slopes + jax.jacfwd(lambda qd: self.velocity_constraint(q, qd, t))(zero) if self.velocity_rows else slopes
        )

    @property
    def velocity_rows(self) -> tuple[int, ...]:
        """Indices of the rows that constrain velocities alone."""
        return self._names.velocity_rows

    def velocity_constraint(
        self, q: Float[Array, "..."], qd: Float[Array, " n"], t: Float[Array, ""], u: Array | None = None
    ) -> Float[Array, " m"]:
        """A(q, t) qd - b(q, t) u of the rows of velocity, and zeros of all others, where there are such; u = t' is 1 if
        it is not given."""
        raise NotImplementedError

    @property
    def may_bend(self) -> bool:
        """Whether its load is a function of the user, which may bend."""
        return False

    @abc.abstractmethod
    def load(self, state: State) -> Float[Array, " n"]:
        """Generalised force Q: applied forces and velocity-dependent inertia terms."""

    @abc.abstractmethod
    def retract(self, q: Float[Array, "..."], d: Float[Array, " n"]) -> Float[Array, "..."]:
        """q [+] d: the position reached from q by the displacement d."""

    def start(self, q: Float[Array, "..."], t: Float[Array, ""]) -> Float[Array, "..."]:
        """Where assembly starts of a guess, which it changes where it knows of constraints that close several ways."""
        return q

    @property
    def doubt(self) -> str:
        """A sentence on why it may not close at all; "" where nothing is known."""
        return ""

    def path(self, q: Float[Array, "..."], rate: Float[Array, " n"]) -> Path | None:
        """Poses of bodies along q [+] s rate, where constraints and slips are known as functions of them."""
        return None

    def displacement(self, base: Float[Array, "..."], q: Float[Array, "..."]) -> tuple[Array, Array] | None:
        """d with base [+] d nearest to q, and whether there is one, where it has a form of its own."""
        return None

    def velocity(self, q: Float[Array, "..."], rate: Float[Array, "..."]) -> Float[Array, " n"] | None:
        """The velocity at which positions have a rate, nearest to it, where it has a form of its own."""
        return None

    def constraint_at(self, at: PyTree, t: Float[Array, ""]) -> Float[Array, " m"]:
        """`constraint` at poses of bodies, where there is a path."""
        raise NotImplementedError

    def velocity_constraint_at(
        self, at: PyTree, rate: PyTree, qd: Float[Array, " n"], t: Float[Array, ""], u: Array | None = None
    ) -> Float[Array, " m"]:
        """`velocity_constraint` at poses of bodies that have rates, where there is a path."""
        raise NotImplementedError

    def slips_at(self, at: PyTree) -> Float[Array, " p"]:
        """Slips of all friction groups at poses of bodies, where there is a path: no functions of time."""
        raise NotImplementedError

    def slip_directions(self, at: PyTree) -> Float[Array, "n p"]:
        """E of all friction groups at poses of bodies, where there is a path."""
        raise NotImplementedError

    @property
    def symbolic(self) -> Symbolic | None:
        """The symbolic factorisation of its sparse matrices, where they are."""
        return None

    @property
    def whole(self) -> Self:
        """The same with dense matrices."""
        return self

    def by_bodies(self, q: Float[Array, "..."], t: Float[Array, ""]) -> tuple[Array, Array]:
        """Where matrices are sparse, slopes as in `Symbolic`, (m, w, s), and each body's mass, (bodies, s, s)."""
        raise NotImplementedError

    @property
    @abc.abstractmethod
    def adds(self) -> bool:
        """Whether q [+] d is q + d."""

    @property
    def reference(self) -> Float[Array, "..."]:
        """The position q that the system is described at, where it is described at one."""
        raise RedundaxError(
            "Argument `q` must be given, as the system is described at no position of its own. Give a guess of it."
        )

    def table(self, state: State) -> str:
        """A state by names and with units, as text: positions, where velocities are their rates, and velocities.

        ??? example

            ```python
            print(mechanism.table(state))
            ```
        """
        if not are_known((state.q, state.qd, state.t)) or state.qd.shape != (len(self.coordinates),):
            return repr(state)
        time, names = f"t = {state.t:.6g} {self.names.units.of('time')}".strip(), self.names
        if self.adds:
            left, right = values_of(names, ("q", state.q), ("qd", state.qd)), []
        else:
            left, right = (
                values_of(names, ("qd", state.qd)),
                values_of(names, ("centres", state.q[: len(names.centres)])),
            )
        if not self.adds and len(names.joint_coordinates):
            motion = joint_motion(self.joint_coordinates, state, jnp.zeros_like(state.qd))
            right += values_of(names, ("joints.position", motion.position)) + values_of(
                names, ("joints.rate", motion.rate)
            )
        return "\n".join([f"State at {time}", *notes(names, ""), *page(left, right, "All of them: state.q, state.qd")])

    @property
    def joint_coordinates(self) -> AbstractJointCoordinates:
        """Coordinates that joints have; none unless a system says so."""
        return NoJointCoordinates()

    def opened(self, kept: Bool[Array, " m"]) -> Self:
        """The same without the rows of contacts that are not `kept`.

        They become rows of zeros, so that programs keep their shapes: these add nothing to the rank, and the multiplier
        of each is a self-stress by itself.
        """
        raise RedundaxError(
            f"Argument `system` has one-sided contacts, but a {type(self).__name__} cannot open them. Give a "
            "`Mechanism` or a `System`."
        )

    @property
    def kept(self) -> Bool[Array, " m"] | None:
        """The rows that it was not `opened` in; None for all."""
        return None

    @property
    @abc.abstractmethod
    def anonymous(self) -> Self:
        """The same system without names: what compiled programs are keyed on."""

    def rubbing(self, factors: Mapping[str, ArrayLike]) -> Self:
        """The same with friction of joints, by name, as a multiple of what their models give."""
        raise RedundaxError(
            f"Argument `friction` must name joints of a `Mechanism`, but the system is a {type(self).__name__}. "
            "Ask for each friction by itself."
        )

    @property
    def without_friction(self) -> Self:
        """The same without friction, which a factorisation does not read, where it can be left out."""
        return self


class System(AbstractSystem):
    """A system from functions that the user writes in jnp.

    Every function takes the parameters as its last argument, so that other values of them compile nothing new.

    ??? example

        ```python
        def pendulum(q, t, p):
            return jnp.array([jnp.hypot(q[0], q[1]) - p["length"]])

        system = rx.System(
            pendulum, mass=jnp.ones(2), load=lambda q, qd, t, p: jnp.array([0.0, -9.81]),
            parameters={"length": 1.0}, rows="force",
        )
        ```

    **Arguments:**

    - `constraint`: `(q, t, parameters) -> (m,)`, the residual Phi(q, t).
    - `mass`: masses (n,), a mass matrix (n, n), or a function `(q, t, parameters) -> (n, n)`.
    - `load`: generalised force `(q, qd, t, parameters) -> (n,)`; zero if not given.
    - `parameters`: any pytree; its numbers become arrays.
    - `coordinates`, `rows`: kinds, one word for all or one for each entry: "linear" or "angular" for
      coordinates, "force" or "moment" for rows, see `Axis`. An `Axis` gives names too.
    - `friction`: one `Friction` or several.
    - `retraction`: `(q, d) -> q`, addition if not given.
    - `n`, `m`: numbers of velocities and rows; needed only where `mass` is a function or kinds are one word
      and cannot be counted (`n` defaults to the size of `mass`, `m` to a trial evaluation at q = 0).
    - `units`: those of all figures, as factors from SI, as for a `Mechanism`; shown nowhere if not given.
    - `one_sided`: names or numbers of rows whose contacts only push: their multiplier is positive or zero, their gap is
      -Phi, and where one would pull it opens.
    - `velocity_constraints`: `(q, qd, t, parameters) -> (k,)`, what the velocity misses of k more rows
      A(q, t) qd - b(q, t) = 0, affine in qd. They stand behind those of `constraint`, which may be `None` then, and
      `rows` holds the kinds of all: of a row in m/s the multiplier is a force, of one in rad/s a moment.
    - `length`: about how large the mechanism is, in the unit of its coordinates, for a system without angles. Gaps and
      residuals are judged beside it, a contact is closed within 1e-6 of it. If not given it is the radius of curvature
      of the rows, and where these are straight, or beside contacts of a radius above 10 m, 1 m. Where no `units` are
      stated that is 10 and 1 of what coordinates are in: with contacts in mm, state units or give the length.
    """

    _names: Names = eqx.field(static=True)
    friction: tuple[AbstractFriction, ...]
    parameters: PyTree
    _mass: Float[Array, " n"] | Float[Array, "n n"] | Callable[..., Array]
    _constraint: Callable[..., Array]
    _load: Callable[..., Array] | None
    _retraction: Callable[..., Array] | None
    _kept: Bool[Array, " m"] | None
    _velocity_constraints: Callable[..., Array] | None
    _length: Float[Array, ""]
    _has_length: bool = eqx.field(static=True)

    def __init__(
        self,
        constraint: Callable[..., Array] | None,
        mass: Numbers | Callable[..., Array],
        load: Callable[..., Array] | None = None,
        parameters: PyTree = None,
        *,
        coordinates: Axis | Sequence[str] | str = "linear",
        rows: Axis | Sequence[str] | str = "force",
        friction: AbstractFriction | Sequence[AbstractFriction] = (),
        retraction: Callable[..., Array] | None = None,
        n: int | None = None,
        m: int | None = None,
        units: Units | None = None,
        one_sided: Sequence[str | int] = (),
        velocity_constraints: Callable[..., Array] | None = None,
        length: ArrayLike | None = None,
    ):
        constraint = no_positions if constraint is None and velocity_constraints is not None else _needed(constraint)
        for argument, function, given in (
            ("constraint", constraint, ("q", "t", "parameters")),
            ("mass", mass, ("q", "t", "parameters")),
            ("load", load, ("q", "qd", "t", "parameters")),
            ("retraction", retraction, ("q", "d")),
            ("velocity_constraints", velocity_constraints, ("q", "qd", "t", "parameters")),
        ):
            if function is not None and (callable(function) or argument != "mass"):
                check_takes(argument, function, *given)
        check_whole(1, **{name: count for name, count in (("n", n), ("m", m)) if count is not None})
        self.parameters, self._kept = as_parameters(parameters), None
        self._constraint, self._load, self._retraction = map(as_functions, (constraint, load, retraction))
        self._velocity_constraints = as_functions(velocity_constraints)
        self._mass = as_functions(mass) if callable(mass) else as_float(mass, "mass")
        if n is None:
            n = _count("coordinates", coordinates) if callable(self._mass) else self._mass.shape[0]
        if n is None:
            raise RedundaxError(
                "Argument `n` must be given where `mass` is a function and `coordinates` one word. "
                "Give the number of velocities."
            )
        if not callable(self._mass) and self._mass.shape not in ((n,), (n, n)):
            raise RedundaxError(
                f"Argument `mass` must have shape ({n},) or ({n}, {n}), but has {self._mass.shape}. "
                "Give one mass for each coordinate, or a matrix."
            )
        if m is None:
            m = _count("rows", rows)
        if m is None:
            m = self._trial_rows(n) + self._trial_velocities(n)
        self.friction = tuple(friction) if isinstance(friction, Sequence) else (friction,)
        for group in self.friction:
            advice = "Give `rx.Friction(slip, force, rows=..., kinds=...)`; models such as `rx.Coulomb` go to joints."
            check_kind("friction", group, AbstractFriction, "friction of a system", advice)
        coordinates, rows = axis("coordinates", coordinates, n), axis("rows", rows, m)
        coordinates.check("coordinates", ("linear", "angular"))
        rows.check("rows", ("force", "moment"))
        for group in self.friction:
            if is_concrete(group.rows) and np.any((np.asarray(group.rows) < -m) | (np.asarray(group.rows) >= m)):
                raise RedundaxError(
                    f"Argument `rows` of the friction must hold indices of the {m} constraint rows, but holds "
                    f"{np.asarray(group.rows).ravel().tolist()}. Count from 0."
                )
        contacts = tuple(sorted(_index(row, rows) for row in names_in("one_sided", one_sided)))
        named = stated(units)
        self._has_length, self._length = length is not None, _length_of(length, coordinates, named)
        self._names = Names(
            coordinates,
            rows,
            pushing=contacts,
            one_sided=contacts,
            velocity_rows=self._velocity_rows_of(n, m, contacts),
            units=named,
            adds=retraction is None,
        )
        if not len(self.rows):
            raise RedundaxError(
                "Argument `constraint` must give at least one residual, but gives none. "
                "Return an array with one entry for each constraint."
            )

    def _velocity_rows_of(self, n: int, m: int, contacts: tuple[int, ...]) -> tuple[int, ...]:
        """The last of m rows, as many as `velocity_constraints` gives."""
        if not (count := self._trial_velocities(n)):
            return ()
        if (others := self._trial_rows(n)) + count != m:
            raise RedundaxError(
                f"Argument `rows` must have a kind for each of the {others} rows of `constraint` and then of the "
                f"{count} of `velocity_constraints`, but has {m}. Give as many, or one word for all."
            )
        rows = tuple(range(m - count, m))
        if wrong := sorted(set(contacts) & set(rows)):
            raise RedundaxError(
                f"Argument `one_sided` must hold no rows of `velocity_constraints`, but holds {wrong[0]}: they have no "
                "gap. Leave it out."
            )
        return rows

    def _trial_velocities(self, n: int) -> int:
        if self._velocity_constraints is None:
            return 0
        if self._retraction is not None:
            raise RedundaxError(
                "Argument `velocity_constraints` must be left out where a `retraction` is given: no position is known "
                "at which to check it. Give rows of velocity by the joints of a `Mechanism`."
            )
        return rows_of_velocity(self._velocity_constraints, self.parameters, n)

    def _trial_rows(self, n: int) -> int:
        if self._retraction is not None:
            raise RedundaxError(
                "Argument `m` must be given where a `retraction` is given and `rows` is one word. "
                "Give the number of constraints."
            )
        value = jax.eval_shape(lambda q, t: self._constraint(q, t, self.parameters), jnp.zeros(n), jnp.zeros(()))
        if value.ndim != 1:
            raise RedundaxError(
                f"Argument `constraint` must return a vector of residuals, but returns shape {value.shape}. "
                "Return `jnp.array([...])` or `jnp.stack([...])`."
            )
        return value.shape[0]

    @property
    def constant_mass(self) -> bool:
        return not callable(self._mass)

    @property
    def diagonal_mass(self) -> bool:
        return not callable(self._mass) and self._mass.ndim == 1

    @found_once
    def anonymous(self) -> Self:
        return replace_fields(
            self, _names=self._names.anonymous, friction=tuple(group.anonymous for group in self.friction)
        )

    @found_once
    def without_friction(self) -> Self:
        return replace_fields(self, friction=())

    def mass(self, q: Array, t: Array) -> Float[Array, "n n"]:
        value = self._mass(q, t, self.parameters) if callable(self._mass) else self._mass
        return jnp.diag(value) if value.ndim == 1 else value

    def constraint(self, q: Array, t: Array) -> Float[Array, " m"]:
        own = self._constraint(q, t, self.parameters)
        return among(self._kept, jnp.pad(own, (0, len(self.velocity_rows))) if self.velocity_rows else own)

    def velocity_constraint(self, q: Array, qd: Array, t: Array, u: Array | None = None) -> Float[Array, " m"]:
        missed = cast(Callable[..., Array], self._velocity_constraints)
        own = missed(q, qd, t, self.parameters)
        if u is not None:
            own = own - (1 - u) * missed(q, jnp.zeros_like(qd), t, self.parameters)
        return among(self._kept, jnp.pad(own, (len(self.rows) - len(self.velocity_rows), 0)))

    def opened(self, kept: Array) -> Self:
        return replace_fields(self, _kept=kept)

    @property
    def kept(self) -> Array | None:
        return self._kept

    @property
    def length(self) -> Array:
        return self._length

    @property
    def has_length(self) -> bool:
        return self._has_length

    @property
    def may_bend(self) -> bool:
        return self._load is not None

    def load(self, state: State) -> Float[Array, " n"]:
        if self._load is None:
            return jnp.zeros_like(state.qd)
        return self._load(state.q, state.qd, state.t, self.parameters)

    def retract(self, q: Array, d: Array) -> Array:
        return moved(q, d) if self._retraction is None else self._retraction(q, d)

    @property
    def adds(self) -> bool:
        return self._retraction is None


def among(kept: Bool[Array, " m"] | None, rows: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
    """What rows have, and zeros of those that are not kept; where none is left out, all of them."""
    return rows if kept is None else jnp.where(kept.reshape(-1, *(1,) * (rows.ndim - 1)), rows, 0.0)


def _index(row: str | int, rows: Axis) -> int:
    """The number of a row of `one_sided`."""
    if isinstance(row, str):
        return index_of("one_sided", row, rows.labels, " of rows")
    if not 0 <= row < len(rows):
        raise RedundaxError(
            f"Argument `one_sided` must hold names of rows or their numbers from 0 to {len(rows) - 1}, but holds {row}."
            " Count from 0."
        )
    return int(row)


def _length_of(length: ArrayLike | None, coordinates: Axis, units: StatedUnits) -> Float[Array, ""]:
    """The size that is declared, or 1 m, or 1 where no units are stated."""
    if length is None:
        return as_float(units.length or 1.0)
    if coordinates.angular.any():
        raise RedundaxError(
            "Argument `length` must be left out where coordinates are angular: rows tell it there. Leave it out."
        )
    size = as_float(length, "length")
    one_number("length", size, "Give one for all.")
    finite("length", size)
    positive("length", size)
    return size


def _count(argument: str, kinds: Axis | Sequence[str] | str) -> int | None:
    if isinstance(kinds, str):
        return None
    return len(kinds) if isinstance(kinds, Axis) else len(names_in(argument, kinds))


def check_system(system: object) -> None:
    """Refuse what is no system, and one that nothing constrains."""
    check_kind("system", system, AbstractSystem, "a mechanism or system", "Give that first, then its state.")
    if not len(cast(AbstractSystem, system).rows):
        raise RedundaxError(
            "Argument `system` must have a constraint, but has none: all of its bodies are free. Add a joint that "
            "holds one of them."
        )


def check_system_at(system: object, state: object) -> None:
    """Refuse what is no system, or no state."""
    check_system(system)
    advice = "Make one by `rx.assemble(mechanism, q)`, by `mechanism.state(...)` or by `rx.State(q, qd)`."
    check_kind("state", state, State, "a state", advice)


def _needed(constraint: Callable[..., Array] | None) -> Callable[..., Array]:
    if constraint is None:
        raise RedundaxError(
            "Argument `constraint` must be a function where there are no `velocity_constraints`, but is None. Give "
            "`(q, t, parameters) -> residuals`, of one row at least."
        )
    return constraint
