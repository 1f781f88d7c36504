"""Friction models of joints.

    Coulomb                  tau = -mu (N + preload) sense                                 (41)
    regularised              tau = -mu (N + preload) tanh(rate / velocity)
    Stribeck                 tau = -(kinetic + (static - kinetic) exp(-(rate / velocity)^2)) (N + preload) sense
                                   - viscous rate
    independent of load      tau = -force sense                                      (24)
    Dahl, LuGre              tau = -(N + preload) (stiffness z + ...),   z' = rate - stiffness |rate| z / g(rate)

N is the joint's normal load: the joint force of a revolute, |N1| + |N2| at the ends of a translational guide.
tau acts on body i and -tau on body j; the sense is the sign of the slip rate of i relative to j. z is the deflection of
bristles, an internal state that `simulate` integrates; it starts at zero.

Models are those of sliding surfaces. In a revolute these are at the radius of its pin: tau is the radius times their
force, and their rate the radius times that of the angle.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._tools._module import figure, floats, not_negative, positive, safe_norm
from .._tools._value import AbstractModule


class AbstractFrictionModel(AbstractModule):
    """Friction of a joint from its normal load, slip rate and sense.

    Surfaces that slide in several directions have their speed as the slip rate and friction against their velocity;
    models with an internal state are given that velocity, and an internal state of as many components.

    `is_proportional` says whether the force is a constant and a multiple of the normal load, at any slip rate: proofs
    rest on it. `bends` says whether the force under a given load, or the rate of the internal state, may bend as the
    slip rate changes: derivatives of motions look for it.
    """

    depends_on_load: eqx.AbstractClassVar[bool]
    has_sense: eqx.AbstractClassVar[bool]
    is_proportional: ClassVar[bool] = False
    bends: ClassVar[bool] = True

    @abc.abstractmethod
    def force(
        self, normal_load: Float[Array, ""], rate: Float[Array, ""], sense: Float[Array, ""], memory: PyTree
    ) -> Float[Array, ""]:
        """Friction force (N) or moment (N m) tau on body i; `memory` is its internal state, if any."""

    @abc.abstractmethod
    def slope_bound(self, rate: Float[Array, ""], memory: PyTree) -> Float[Array, ""]:
        """Largest |d tau / d N| at a slip rate and internal state; infinite where none is known."""

    def memory_size(self) -> PyTree:
        """Sizes of the internal state, which starts at zero; `None` without one."""
        return None

    def memory_rate(self, rate: Float[Array, ""], memory: PyTree) -> PyTree:
        """Rate of change of the internal state; `None` without one."""
        return None

    def about(self, radius: Float[Array, ""]) -> "AbstractFrictionModel":
        """The model of the moment of surfaces at a radius, from the rate of the angle."""
        return _AtRadius(self, radius)


class _AbstractOfModel(AbstractFrictionModel):
    """Friction that follows from that of a model."""

    model: eqx.AbstractVar[AbstractFrictionModel]

    @property
    def depends_on_load(self) -> bool:
        """As the model."""
        return self.model.depends_on_load

    @property
    def has_sense(self) -> bool:
        """As the model."""
        return self.model.has_sense

    @property
    def is_proportional(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As the model."""
        return self.model.is_proportional

    @property
    def bends(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As the model."""
        return self.model.bends

    def memory_size(self) -> PyTree:
        return self.model.memory_size()


class _AtRadius(_AbstractOfModel):
    model: AbstractFrictionModel
    radius: Float[Array, ""]

    def __init__(self, model: AbstractFrictionModel, radius: Float[Array, ""]):
        self.model, self.radius = model, radius

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return self.radius * self.model.force(normal_load, self.radius * rate, sense, memory)

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return self.radius * self.model.slope_bound(self.radius * rate, memory)

    def memory_rate(self, rate: Array, memory: PyTree) -> PyTree:
        return self.model.memory_rate(self.radius * rate, memory)


class Times(_AbstractOfModel):
    """A multiple of the friction of a model."""

    model: AbstractFrictionModel
    factor: Float[Array, "..."]

    def __init__(self, model: AbstractFrictionModel, factor: Float[Array, "..."]):
        self.model, self.factor = model, factor

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return self.factor * self.model.force(normal_load, rate, sense, memory)

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return self.factor * self.model.slope_bound(rate, memory)

    def memory_rate(self, rate: Array, memory: PyTree) -> PyTree:
        return self.model.memory_rate(rate, memory)


class Coulomb(AbstractFrictionModel):
    """Coulomb friction (41), (42), proportional to the normal load.

    ??? example

        ```python
        bearing = rx.Coulomb(0.3, preload=50.0)  # N
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=bearing)
        ```

    **Arguments:**

    - `mu`: friction coefficient of the surfaces.
    - `preload`: normal load from bearing preload, N, added to that of the joint.
    """

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = True
    is_proportional: ClassVar[bool] = True
    bends: ClassVar[bool] = False
    mu: Float[Array, ""] = eqx.field(converter=figure("mu"))
    preload: Float[Array, ""] = eqx.field(converter=figure("preload"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("mu", "preload"):
            not_negative(name, getattr(self, name))

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return -self.mu * (normal_load + self.preload) * sense

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.abs(self.mu)

    def about(self, radius: Array) -> "Coulomb":
        return Coulomb(floats(radius) * floats(self.mu), self.preload)


class RegularisedCoulomb(AbstractFrictionModel):
    """Coulomb friction whose sense is smooth in the slip rate: it creeps where Coulomb friction sticks.

        tau = -mu (N + preload) tanh(rate / velocity)

    ??? example

        ```python
        bearing = rx.RegularisedCoulomb(0.3, velocity=1e-5)  # m/s
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=bearing)
        ```

    **Arguments:**

    - `mu`, `preload`: as of `Coulomb`.
    - `velocity`: of slip at which 76 % of the friction acts, m/s.
    """

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = False
    is_proportional: ClassVar[bool] = True
    bends: ClassVar[bool] = False
    mu: Float[Array, ""] = eqx.field(converter=figure("mu"))
    velocity: Float[Array, ""] = eqx.field(converter=figure("velocity"))
    preload: Float[Array, ""] = eqx.field(converter=figure("preload"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("mu", "preload"):
            not_negative(name, getattr(self, name))

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return -self.mu * (normal_load + self.preload) * jnp.tanh(rate / self.velocity)

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.abs(self.mu * jnp.tanh(rate / self.velocity))


class Stribeck(AbstractFrictionModel):
    """Coulomb friction that falls from its value at rest as slip sets in, with a viscous part.

        tau = -(kinetic + (static - kinetic) exp(-(rate / velocity)^2)) (N + preload) sense - viscous rate

    ??? example

        ```python
        bearing = rx.Stribeck(static=0.4, kinetic=0.2, velocity=1e-3, viscous=10.0)
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=bearing)
        ```

    **Arguments:**

    - `static`, `kinetic`: coefficients at rest and in fast slip, as of `Coulomb`.
    - `velocity`: Stribeck velocity, m/s.
    - `viscous`: N s/m.
    - `preload`: as of `Coulomb`.
    """

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = True
    is_proportional: ClassVar[bool] = True
    bends: ClassVar[bool] = False
    static: Float[Array, ""] = eqx.field(converter=figure("static"))
    kinetic: Float[Array, ""] = eqx.field(converter=figure("kinetic"))
    velocity: Float[Array, ""] = eqx.field(converter=figure("velocity"))
    viscous: Float[Array, ""] = eqx.field(converter=figure("viscous"), default=0.0)
    preload: Float[Array, ""] = eqx.field(converter=figure("preload"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("static", "kinetic", "viscous", "preload"):
            not_negative(name, getattr(self, name))

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        coefficient = _falling(self.static, self.kinetic, rate / self.velocity)
        return -coefficient * (normal_load + self.preload) * sense - self.viscous * rate

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.maximum(jnp.abs(self.static), jnp.abs(self.kinetic))


class ConstantFriction(AbstractFrictionModel):
    """Dry friction that does not depend on load, Eq. (24), as from seals.

    ??? example

        ```python
        seal = rx.ConstantFriction(20.0)  # N
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=seal)
        ```

    **Arguments:**

    - `size`: friction force of the surfaces, N. Of a joint that turns the torque is `size` times its radius, so that
      with `pin_radius=1.0` it is the torque itself, N m.
    """

    depends_on_load: ClassVar[bool] = False
    has_sense: ClassVar[bool] = True
    is_proportional: ClassVar[bool] = True
    bends: ClassVar[bool] = False
    size: Float[Array, ""] = eqx.field(converter=figure("size"))

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return -self.size * sense

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.zeros_like(self.size)


class Dahl(AbstractFrictionModel):
    """Coulomb friction with bristles between the surfaces: before slip they deflect, with hysteresis.

        tau = -(N + preload) stiffness z,   z' = rate - stiffness |rate| z / mu

    From z = 0 a shift x > 0 gives z = (1 - exp(-stiffness x / mu)) mu / stiffness. There is no jump
    at a reversal, so that joints come to rest on their bristles and never stick. Short bristles make it stiff, see
    `LuGre`.

    ??? example

        ```python
        bearing = rx.Dahl(0.3, stiffness=3000.0)  # 1/m: bristles bend by 1e-4 m, 0.01 rad of the pin
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=bearing)
        ```

    **Arguments:**

    - `mu`, `preload`: as of `Coulomb`; `mu` is positive.
    - `stiffness`: of the bristles for a normal load of 1: `mu` over the largest deflection, 1/m.
    """

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = False
    is_proportional: ClassVar[bool] = True
    mu: Float[Array, ""] = eqx.field(converter=figure("mu"))
    stiffness: Float[Array, ""] = eqx.field(converter=figure("stiffness"))
    preload: Float[Array, ""] = eqx.field(converter=figure("preload"), default=0.0)

    def __check_init__(self) -> None:
        positive("mu", self.mu)
        positive("stiffness", self.stiffness)
        not_negative("preload", self.preload)

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return -(normal_load + self.preload) * self.stiffness * memory

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.abs(self.stiffness * memory)

    def memory_size(self) -> Array:
        return self.mu / self.stiffness

    def memory_rate(self, rate: Array, memory: PyTree) -> Array:
        return rate - self.stiffness * _speed(rate) * memory / self.mu


class LuGre(AbstractFrictionModel):
    """`Stribeck` friction with bristles between the surfaces, which deflect and damp before slip.

        tau = -(N + preload) (stiffness z + damping z' + viscous rate),   z' = rate - stiffness |rate| z / g(rate)
        g = kinetic + (static - kinetic) exp(-(rate / velocity)^2)

    There is no jump at a reversal, so that joints come to rest on their bristles and never stick. Bristles relax at the
    rate stiffness |rate| / g; where that is thousands of times faster than the motion, `simulate` takes `Radau()`,
    which inside of transformations is given by hand. The damping times the largest slip rate should stay well
    below `static`, or to begin to slip takes more friction than slip itself.

    ??? example

        ```python
        bearing = rx.LuGre(static=0.4, kinetic=0.3, velocity=1e-3, stiffness=3000.0, damping=20.0)  # m/s; 1/m; s/m
        rx.Revolute("A", "lever", "ground", (0.0, 0.0), (0.0, 0.0), pin_radius=0.01, friction=bearing)
        ```

    **Arguments:**

    - `static`, `kinetic`, `velocity`: as of `Stribeck`; the coefficients are positive.
    - `stiffness`: of the bristles for a normal load of 1, 1/m.
    - `damping`, `viscous`: of bristles and of slip for a normal load of 1, s/m.
    - `preload`: as of `Coulomb`.
    """

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = False
    is_proportional: ClassVar[bool] = True
    static: Float[Array, ""] = eqx.field(converter=figure("static"))
    kinetic: Float[Array, ""] = eqx.field(converter=figure("kinetic"))
    velocity: Float[Array, ""] = eqx.field(converter=figure("velocity"))
    stiffness: Float[Array, ""] = eqx.field(converter=figure("stiffness"))
    damping: Float[Array, ""] = eqx.field(converter=figure("damping"), default=0.0)
    viscous: Float[Array, ""] = eqx.field(converter=figure("viscous"), default=0.0)
    preload: Float[Array, ""] = eqx.field(converter=figure("preload"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("static", "kinetic", "stiffness"):
            positive(name, getattr(self, name))
        for name in ("damping", "viscous", "preload"):
            not_negative(name, getattr(self, name))

    def force(self, normal_load: Array, rate: Array, sense: Array, memory: PyTree) -> Array:
        return -(normal_load + self.preload) * self._share(rate, memory)

    def slope_bound(self, rate: Array, memory: PyTree) -> Array:
        return jnp.abs(self._share(rate, memory))

    def memory_size(self) -> Array:
        return self.static / self.stiffness

    def memory_rate(self, rate: Array, memory: PyTree) -> Array:
        coefficient = _falling(self.static, self.kinetic, _speed(rate) / self.velocity)
        return rate - self.stiffness * _speed(rate) * memory / coefficient

    def _share(self, rate: Array, memory: Array) -> Array:
        """-tau for a normal load of 1."""
        return self.stiffness * memory + self.damping * self.memory_rate(rate, memory) + self.viscous * rate


def _speed(rate: Array) -> Array:
    """Size of a slip rate, or of a velocity of surfaces that slide in several directions."""
    return jnp.abs(rate) if rate.ndim == 0 else safe_norm(rate)


def _falling(static: Array, kinetic: Array, rate: Array) -> Array:
    """Coefficient that falls from its value at rest as slip sets in; the rate relative to the Stribeck velocity."""
    return kinetic + (static - kinetic) * jnp.exp(-(rate**2))
