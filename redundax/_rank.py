"""Rank of the constraints and the two projectors that the rank decides.

The rank is kinematic: it is decided on the scaled Jacobian

    K = D^-1 Phi_q S

of `_scaling`, which is free of units, so the spectrum does not move with the unit, and mass does not enter.
With the singular value decomposition K = U diag(sigma) V^T cut at rank r,

    K^+ = V sigma^-1 U^T,   P = I - U U^T  (self-stress, onto null K^T),   Z = I - V V^T  (motion, onto null K).

Traced code knows the self-stress space and the space of motions only through P and Z: they have a fixed
shape, need no basis, and at constant rank have the derivatives (Golub and Pereyra)

    dP = -P dK K^+ - (P dK K^+)^T,   dZ = -K^+ dK Z - (K^+ dK Z)^T,
    dK^+ = -K^+ dK K^+ + K^+ K^+T dK^T P + Z dK^T K^+T K^+.

They follow from P K = 0, K Z = 0 and the Penrose conditions; repeated singular values do them no harm.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


class Spectrum(eqx.Module):
    """The rank decision and the evidence for it, all free of units.

    - `singular_values`: of the scaled Jacobian K, relative to the largest, descending.
    - `rank`: r, number of independent constraints.
    - `tolerance`: singular values above it count; it grows with the constraint violation.
    - `gap`: smallest kept over largest dropped singular value; infinite if none is dropped.
    - `ambiguous`: a singular value is too close to the tolerance to call, or the declared rank is impossible.
    """

    singular_values: Float[Array, " s"]
    rank: Int[Array, ""]
    tolerance: Float[Array, ""]
    gap: Float[Array, ""]
    ambiguous: Bool[Array, ""]


class Split(NamedTuple):
    """K^+ (n, m), self-stress projector P (m, m) and motion projector Z (n, n)."""

    inverse: Float[Array, "n m"]
    stress: Float[Array, "m m"]
    motion: Float[Array, "n n"]


def spectrum(
    singular_values: Float[Array, " s"],
    shape: tuple[int, int],
    violation: Float[Array, ""],
    rank: Int[Array, ""] | None,
) -> Spectrum:
    """Decide the rank from the singular values, rounding and the constraint violation, or take it declared.

    Off the manifold by a relative distance v, a permanently redundant row shows a singular value below v, and the
    decomposition one of a few roundings. The tolerance is 30 times both; what is kept must lie 10 times above
    it, and what is dropped must look like v and rounding, or the rank is ambiguous.
    """
    dtype = singular_values.dtype
    values = singular_values / jnp.maximum(singular_values[0], jnp.finfo(dtype).tiny)
    noise = max(shape) * jnp.finfo(dtype).eps
    tolerance = 30 * (noise + violation)
    rounding = 10 * jnp.finfo(dtype).eps  # what the decomposition leaves of a zero
    decided = jnp.sum(values > tolerance) if rank is None else rank
    kept = jnp.where(decided > 0, values[jnp.clip(decided - 1, 0)], jnp.inf)
    dropped = jnp.append(values, jnp.zeros((), dtype))[jnp.clip(decided, 0, values.size)]
    if rank is None:
        ambiguous = (kept < 10 * tolerance) | (dropped > rounding + violation)
    else:
        ambiguous = (kept <= 3 * noise) | (rank < 0) | (rank > values.size)
    gap = jnp.where(dropped > 0, kept / jnp.where(dropped > 0, dropped, 1.0), jnp.inf)
    return Spectrum(values, decided, tolerance, gap, ambiguous)


def split(
    scaled: Float[Array, "m n"], violation: Float[Array, ""], rank: Int[Array, ""] | None
) -> tuple[Split, Spectrum]:
    """Decide the rank of the scaled Jacobian and return K^+, P and Z, differentiable at constant rank."""
    u, sigma, vt = jnp.linalg.svd(jax.lax.stop_gradient(scaled), full_matrices=False)
    decided = spectrum(sigma, (scaled.shape[0], scaled.shape[1]), jax.lax.stop_gradient(violation), rank)
    return _split(scaled, u, sigma, vt, decided.rank), decided


@jax.custom_jvp
def _split(scaled: Array, u: Array, sigma: Array, vt: Array, rank: Array) -> Split:
    kept = jnp.arange(sigma.size) < rank
    inverse = vt.T @ (jnp.where(kept, 1 / jnp.where(kept, sigma, 1.0), 0.0)[:, None] * u.T)
    m, n = scaled.shape
    blur = max(m, n) * jnp.finfo(u.dtype).eps * sigma[0] / sigma[jnp.clip(rank - 1, 0)]
    return Split(
        inverse,
        _without_rounding(jnp.where(rank < m, jnp.eye(m, dtype=u.dtype) - (u * kept) @ u.T, 0.0), blur),
        _without_rounding(jnp.where(rank < n, jnp.eye(n, dtype=u.dtype) - (vt.T * kept) @ vt, 0.0), blur),
    )


def _without_rounding(projector: Array, blur: Array) -> Array:
    """The projector with rows and columns that are rounding set to zero, as a soft row would magnify them."""
    true = jnp.linalg.norm(projector, axis=1) > blur
    return jnp.where(true[:, None] & true, projector, 0.0)


@_split.defjvp
def _split_jvp(primals: tuple, tangents: tuple) -> tuple[Split, Split]:
    change = tangents[0]  # derivation: module docstring
    inverse, stress, motion = out = _split(*primals)
    stress_part = stress @ change @ inverse
    motion_part = inverse @ change @ motion
    inverse_dot = (
        -inverse @ change @ inverse + inverse @ inverse.T @ change.T @ stress + motion @ change.T @ inverse.T @ inverse
    )
    return out, Split(inverse_dot, -stress_part - stress_part.T, -motion_part - motion_part.T)
