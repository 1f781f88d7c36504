"""The equations at a state where rows that are redundant carry nothing, as far as the self-stress lets them.

With E the columns of the identity of these rows, in scaled multipliers,

    mu -> (I - R) mu,   P -> (I - R) P,   K^+ -> K^+ (I - R)^T,   R = P E (E^T P E)^+ E^T.

The rank stays, and so do motions: the rows are met by what the others do.
"""

from jaxtyping import Array, Bool, Float

from .._tools._module import replace_fields
from .._tools._numbers import xp
from ._factorisation import Factorisation

_NONE = 1e-9  # of an eigenvalue of E^T P E, at most 1: far above the rounding of P, far below a part in the self-stress


def among_unloaded(factor: Factorisation, rows: Bool[Array, " m"]) -> Float[Array, "m m"]:
    """E (E^T P E)^+ E^T."""
    return xp.linalg.pinv(xp.where(rows[:, None] & rows, factor.split.stress, 0.0), rtol=_NONE, hermitian=True)


def unloaded(factor: Factorisation, rows: Bool[Array, " m"]) -> Factorisation:
    """The factorisation without the loads of `rows`; where one is not redundant its load stays."""
    inverse, stress, _ = factor.split
    through = stress @ among_unloaded(factor, rows)
    count = xp.round(xp.trace(through)).astype(factor.spectrum.rank.dtype)
    left = stress - through @ stress
    split = factor.split._replace(stress=(left + left.T) / 2, inverse=inverse - inverse @ through.T)
    mu = factor.row_scale * factor.multipliers
    return replace_fields(
        factor,
        split=split,
        multipliers=(mu - through @ mu) / factor.row_scale,
        spectrum=replace_fields(factor.spectrum, rank=factor.spectrum.rank + count),  # of which the redundancy is left
    )
