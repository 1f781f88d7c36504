"""Identification: parameters from a measured motion, their uncertainty, and what the measurement cannot tell.

    r(p) = (predict(p) - measured) / noise,      chi^2 = |r|^2 -> min

Weighted least squares, the maximum likelihood for independent normal noise, by Levenberg-Marquardt steps (optimistix)
from many starts at once: they need the sensitivities J = dr/dp that the uncertainty is made of anyway, by forward mode,
and get to the minimum in some ten of them where gradient methods (optax) take hundreds. With the standard deviations
D = diag(d) of the parameters before the measurement, from their distributions,

    J D = U S V^T,      covariance of p = D V S^-2 V^T D

and the combination v_k of parameters in units of d has the standard uncertainty 1 / s_k. Where s_k < 1 the measurement
leaves it as uncertain as it was: it is not determined. What is left to do at an end of the search, |U^T r| over the
determined combinations, is the distance to the minimum in standard uncertainties: it alone says whether a search has
converged, whatever made it stop.
"""

from collections.abc import Callable, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import Numbers, as_float, check_call, check_whole, one_number, positive
from ._distributions import AbstractDistribution, check_distributions, check_power, sobol
from ._identification import Ends, Identification, Shapes, Space, identified, restore

_POINTS = 8  # of the ranges, at which the sensitivities must agree on a sum, difference, product or quotient


def identify(
    predict: Callable[..., Array],
    measured: Numbers,
    parameters: Mapping[str, AbstractDistribution],
    *,
    noise: Numbers,
    starts: int = 8,
    max_steps: int = 64,
    rtol: float = 1e-5,
    seed: int = 0,
    throw: bool = True,
) -> Identification:
    """Find parameters from measured outputs, how uncertain they are, and which of them the data cannot determine.

    ??? example

        ```python
        t = jnp.linspace(0.0, 2.0, 21)
        def predict(rate, damping):
            return jnp.exp(-damping * t) * jnp.sin(rate * t)
        ranges = {"rate": rx.Uniform(1.0, 4.0), "damping": rx.Uniform(0.0, 1.0)}
        found = rx.identify(predict, predict(3.0, 0.2), ranges, noise=0.01)
        print(found)  # 3.0, 0.2, each with its uncertainty
        ```

    A motion is predicted by `simulate(..., adjoint=diffrax.ForwardMode()).q[:, k]`, say.

    **Arguments:**

    - `predict`: function with arguments named as in `parameters`, written in jnp and differentiable in forward mode,
      that gives what is measured.
    - `measured`: the measurement, in the shape that `predict` gives.
    - `parameters`: `Uniform` or `Normal` for each argument of `predict`, numbers or arrays: friction coefficients,
      misfits, preloads, compliances. Searches start at Sobol points of them, and their standard deviations are what the
      uncertainty of the estimate is compared with. They do not bound the estimate, nor draw it to them.
    - `noise`: standard deviation of the measurement, a number or one for each.
    - `starts`: number of searches, a power of two; they run as one batch.
    - `max_steps`, `rtol`: steps of a search at most, and its relative tolerance.
    - `seed`: of the scrambling of the Sobol points.
    - `throw`: whether to raise an error where the search did not converge.

    **Returns:** an `Identification`; printed, it is a page.

    **Raises:** `ValueError` for arguments that do not fit; `RuntimeError` where no search converged, or where one that
    did not has the least misfit, and `throw` says so.
    """
    data, sigma = _checked(measured, noise, parameters, starts, max_steps)
    one_number("rtol", as_float(rtol, "rtol"), "Give one for all.")
    positive("rtol", as_float(rtol, "rtol"))
    check_call("predict", predict, **parameters)
    shapes = tuple((name, one.shape) for name, one in parameters.items())
    middle = jnp.concatenate([jnp.ravel(one.nominal) for one in parameters.values()])
    scale = jnp.concatenate([jnp.ravel(one.std) for one in parameters.values()])
    begin = _points(parameters, starts, seed)
    try:
        found = _searches(predict, shapes, begin, (data, sigma), (middle, scale), max_steps, rtol)
    except TypeError as error:
        if "forward-mode" not in str(error):
            raise
        raise RedundaxError(
            "Argument `predict` must be differentiable in forward mode, but is not. Give `simulate` the argument "
            "`adjoint=diffrax.ForwardMode()`."
        ) from error

    def elsewhere() -> tuple[np.ndarray, np.ndarray]:
        u = (_points(parameters, _POINTS, seed) - middle) / scale
        return np.asarray(u), np.asarray(_sensitivities(predict, shapes, u, sigma, middle, scale))

    space = Space(shapes, np.asarray(middle), np.asarray(scale))
    out = identified(Ends(*map(np.asarray, found)), space, elsewhere)
    if out.problem and throw:
        raise NoSolutionError(out.problem)
    return out


def _points(parameters: Mapping[str, AbstractDistribution], count: int, seed: int) -> Array:
    """Values of all entries of the parameters at Sobol points, shape (count, p)."""
    return jnp.concatenate([x.reshape(count, -1) for x in sobol(parameters, count, seed).values()], axis=1)


def _checked(
    measured: Numbers, noise: Numbers, parameters: Mapping[str, AbstractDistribution], starts: int, max_steps: int
) -> tuple[Array, Array]:
    check_distributions(parameters, "What is known belongs into `predict`.")
    check_power("starts", starts, least=1)
    check_whole(1, max_steps=max_steps)
    data, sigma = as_float(measured, "measured"), as_float(noise, "noise")
    if not bool(jnp.all(jnp.isfinite(data))):
        raise RedundaxError(
            "Argument `measured` must be finite. Leave out of it, and of what `predict` gives, what is missing."
        )
    if not bool(jnp.all((sigma > 0) & jnp.isfinite(sigma))):
        raise RedundaxError(f"Argument `noise` must be positive and finite, but is {noise}. Give a standard deviation.")
    if sigma.shape not in ((), data.shape):
        raise RedundaxError(
            f"Argument `noise` must be a number or have the shape of `measured`, {data.shape}, but has {sigma.shape}. "
            "Give one standard deviation for all, or one for each."
        )
    return data, sigma


@eqx.filter_jit
def _searches(
    predict: Callable[..., Array],
    shapes: Shapes,
    begin: Array,
    measured: tuple[Array, Array],
    unit: tuple[Array, Array],
    max_steps: int,
    rtol: float,
) -> tuple[Array, ...]:
    """All searches: where they ended, residuals and sensitivities there; given what was measured and its noise, and
    the middle and the scale of parameters."""
    (data, sigma), (middle, scale) = measured, unit

    def residual(u: Array) -> tuple[Array, Array]:
        given = predict(**restore(shapes, middle + scale * u))
        try:
            given = jnp.asarray(given)
        except (TypeError, ValueError):
            raise RedundaxError(
                f"Argument `predict` must give an array, but gives a {type(given).__name__}. Let it give what was "
                "measured, say by `jnp.stack`."
            ) from None
        if given.shape != data.shape:
            raise RedundaxError(
                f"Argument `measured` must have the shape that `predict` gives, {given.shape}, but has {data.shape}. "
                "Let `predict` give what was measured, at the same times."
            )
        value = ((given - data) / sigma).ravel()
        return value, value

    def linear(u: Array, _: object) -> Array:
        # A step asks for the residual, then for its derivative: one program gives both, so that it is compiled once.
        here = jax.lax.stop_gradient(u)
        slopes, value = jax.jacfwd(residual, has_aux=True)(here)
        return value + slopes @ (u - here)

    import optimistix as optx  # here, as its import takes time that few need

    def search(u: Array) -> tuple[Array, ...]:
        solver = optx.LevenbergMarquardt(rtol=rtol, atol=rtol)
        found = optx.least_squares(linear, solver, u, max_steps=max_steps, throw=False)
        last = found.state.f_info
        return found.value, last.residual, last.jac.as_matrix()

    return jax.vmap(search)((begin - middle) / scale)


@eqx.filter_jit
def _sensitivities(
    predict: Callable[..., Array], shapes: Shapes, points: Array, sigma: Array, middle: Array, scale: Array
) -> Array:
    """Those of the residual at each point."""
    return jax.vmap(jax.jacfwd(lambda u: (predict(**restore(shapes, middle + scale * u)) / sigma).ravel()))(points)
