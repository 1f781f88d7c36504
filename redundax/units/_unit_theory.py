"""What a change of units does to dependent constraints and to the minimum norm, Section 3.

    Phi_q of the dependent rows = eta Phi_q of the independent rows                              (17)
    eta' = s_dependent eta / s_independent                                                       (18)
    lam(p) = [lam0 - eta^T p; p],   lam0: the multipliers of the independent rows alone          (19)
    (I + eta eta^T) p = eta lam0   at minimum norm, for one row p = eta lam0 / (1 + eta eta^T)   (20), (21)
    p' = the same of eta' and lam0' = (e / s_independent) lam0                                   (22), (23)

with s the factors by which the residuals of rows grow (u for force-type rows and 1 for moment-type rows where
lengths grow by u) and e that of energy. So eta' = [eta_Phi, u eta_Ups] of a force-type row, [eta_Phi / u, eta_Ups] of a
moment-type row, and p' differs from (e / s_dependent) p, the same load in the new units, unless the row depends on
rows of its own type alone. The paper has one dependent row; here there may be k.
"""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system._axis import Axis
from .._system._units import Units, check_units_given
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, names_in


def dependence_in_units(
    eta: Numbers, dependent: Sequence[str], independent: Sequence[str], units: Units
) -> Float[Array, "k r"]:
    """eta' (18): how rows depend on others after a change of units.

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        rx.units.dependence_in_units([[0.5, 2.0]], ["force"], ["force", "moment"], millimetres)  # [[0.5, 2000.0]]
        ```

    **Arguments:**

    - `eta`: coefficients (17), shape (k, r), a row for each dependent row.
    - `dependent`, `independent`: kinds of the rows, "force" or "moment", k and r of them.
    - `units`: factors of the change.
    """
    check_units_given(units)
    own, others = _axes(dependent, independent)
    return units.of(own)[:, None] * _coefficients(eta, own, others) / units.of(others)


def minimum_norm_parameters(eta: Numbers, basic: Numbers) -> Float[Array, " k"]:
    """p (21): the multipliers of the dependent rows that give all multipliers the least norm.

    ??? example

        ```python
        rx.units.minimum_norm_parameters([[1.0, 1.0]], [3.0, 0.0])  # 3 / (1 + 2) = [1.0]
        ```

    **Arguments:**

    - `eta`: coefficients (17), shape (k, r).
    - `basic`: lam0, multipliers of the independent rows with those of the dependent rows zero, shape (r,).
    """
    eta = as_float(eta, "eta")
    return jnp.linalg.solve(jnp.eye(eta.shape[0], dtype=eta.dtype) + eta @ eta.T, eta @ as_float(basic, "basic"))


def minimum_norm_parameters_in_units(
    eta: Numbers, basic: Numbers, dependent: Sequence[str], independent: Sequence[str], units: Units
) -> Float[Array, " k"]:
    """p' (22), (23): the same after a change of units, in the new units; `eta`, `basic` are in the old ones.

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        kinds = ["force"], ["force", "moment"]
        rx.units.minimum_norm_parameters_in_units([[1.0, 1.0]], [3.0, 0.0], *kinds, millimetres)  # [0.003]
        ```
    """
    _, others = _axes(dependent, independent)
    there = dependence_in_units(eta, dependent, independent, units)
    return minimum_norm_parameters(there, units.of_force(others) * as_float(basic, "basic"))


def parametrised_multipliers(
    eta: Numbers, basic: Numbers, parameters: Numbers
) -> tuple[Float[Array, " r"], Float[Array, " k"]]:
    """lam(p) (19): multipliers of the independent and of the dependent rows, a solution for every p.

    ??? example

        ```python
        rx.units.parametrised_multipliers([[1.0, 1.0]], [3.0, 0.0], [1.0])  # ([2.0, -1.0], [1.0])
        ```
    """
    p = as_float(parameters, "parameters")
    return as_float(basic, "basic") - as_float(eta, "eta").T @ p, p


def _axes(dependent: Sequence[str], independent: Sequence[str]) -> tuple[Axis, Axis]:
    given = {"dependent": dependent, "independent": independent}
    axes = [Axis(None, tuple(names_in(name, kinds))) for name, kinds in given.items()]
    for name, axis in zip(given, axes, strict=True):
        axis.check(name, ("force", "moment"))
    return axes[0], axes[1]


def _coefficients(eta: Numbers, dependent: Axis, independent: Axis) -> Array:
    array = as_float(eta, "eta")
    if array.shape != (len(dependent), len(independent)):
        raise RedundaxError(
            f"Argument `eta` must have a row for each of {len(dependent)} dependent rows and a column for each of "
            f"{len(independent)} independent ones, but has shape {array.shape}. "
            "`Report.dependencies` gives such coefficients."
        )
    return array
