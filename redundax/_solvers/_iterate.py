"""The one loop that all friction iterations share, with the paper's two-stage stop.

An iteration ends when the change of the right-hand side b (fixed point) or the residual G (Newton) is small
AND THEN the step in x is small (Sections 4.2.2 and 4.2.3): with a rank-deficient matrix a small step alone
says nothing.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._system._results import RESULTS, chosen
from .._tools._numbers import stop_gradient, while_loop, xp
from .._tools._value import value

Y = TypeVar("Y", bound=PyTree)

# Updates without a smaller residual after which an iteration is given up.
_PATIENCE = 20


@value
class Progress:
    """How an iteration went.

    - `steps`: iterations done.
    - `residual`: last relative change of b, or relative residual G.
    - `step`: last relative change of the loads.
    - `best`: smallest residual so far.
    - `stalled`: updates since it was found.
    """

    steps: Int[Array, "..."]
    residual: Float[Array, "..."]
    step: Float[Array, "..."]
    best: Float[Array, "..."]
    stalled: Int[Array, "..."]

    @classmethod
    def begin(cls, dtype: DTypeLike) -> "Progress":
        """Before the first iteration."""
        infinite, none = xp.full((), xp.inf, dtype), xp.zeros((), int)
        return cls(none, infinite, infinite, infinite, none)

    @classmethod
    def done(cls, dtype: DTypeLike) -> "Progress":
        """Where nothing has to be iterated."""
        zero, none = xp.zeros((), dtype), xp.zeros((), int)
        return cls(none, zero, zero, zero, none)

    def after(self, residual: Float[Array, "..."], step: Float[Array, "..."]) -> "Progress":
        """One update later."""
        better = residual < self.best
        return Progress(
            self.steps + 1, residual, step, xp.where(better, residual, self.best), xp.where(better, 0, self.stalled + 1)
        )

    def unfinished(self, rtol: Float[Array, ""], max_steps: int) -> Bool[Array, "..."]:
        """Whether to go on: not converged, finite, neither stalled nor out of steps."""
        finite = xp.isfinite(self.residual) & xp.isfinite(self.step)
        going = finite & ~self.converged(rtol) & (self.stalled < _PATIENCE) & (self.steps < max_steps)
        return going | (self.steps == 0)

    def converged(self, rtol: Float[Array, ""]) -> Array:
        """Whether residual and step meet the tolerance, or the residual does and rounding keeps the step from it.

        Near a fold the step is the residual magnified; there it tells how many digits rounding leaves.
        """
        at_rounding = (self.stalled >= 3) & (self.step <= xp.sqrt(xp.finfo(rtol.dtype).eps))
        return (self.residual <= rtol) & ((self.step <= rtol) | at_rounding)

    def result(self, rtol: Float[Array, ""]) -> RESULTS:
        """The outcome as a value."""
        finite = xp.isfinite(self.residual) & xp.isfinite(self.step)
        failure = chosen(self.stalled < _PATIENCE, RESULTS.max_steps_reached, RESULTS.no_contraction)
        failure = chosen(finite, failure, RESULTS.diverged)
        return chosen(self.converged(rtol), RESULTS.successful, failure)


def iterate(
    update: Callable[[Y], tuple[Y, Array, Array]],
    start: Y,
    rtol: Float[Array, ""],
    max_steps: int,
    *,
    bounded: bool = False,
) -> tuple[Y, Progress]:
    """Repeat `update: y -> (y, residual, step)` until converged, not finite, stalled, or out of steps.

    `bounded` runs a scan of
    `max_steps` masked iterations instead of a while loop, which reverse mode can pass through.
    """
    first = (start, Progress.begin(rtol.dtype))

    def unfinished(carry: tuple[Y, Progress]) -> Array:
        return carry[1].unfinished(rtol, max_steps)

    def body(carry: tuple[Y, Progress]) -> tuple[Y, Progress]:
        y, progress = carry
        y, residual, step = update(y)
        return y, progress.after(*stop_gradient((residual, step)))

    if not bounded:
        return while_loop(unfinished, body, first)

    def masked(carry: tuple[Y, Progress], _: None) -> tuple[tuple[Y, Progress], None]:
        on = unfinished(carry)
        return jax.tree.map(lambda new, old: xp.where(on, new, old), body(carry), carry), None

    return jax.lax.scan(masked, first, None, length=max_steps)[0]


def run_unless(done: Bool[Array, ""], end: Y, search: Callable[..., Y], *operands: Float[Array, "..."]) -> Y:
    """`end` where done, else `search(*operands)`, which runs where a sample of a batch asks for it and not otherwise.

    What the search needs goes through the carry, or XLA takes it out of the loop; where done it is NaN, so that the
    search ends at once.
    """

    def body(carry: tuple[Array, Y]) -> tuple[Array, Y]:
        return xp.ones_like(carry[0]), search(*(xp.where(carry[0], xp.nan, x) for x in operands))

    return while_loop(lambda carry: ~carry[0], body, (done, end))[1]
