"""Decisions that rounding can turn: yes, no, or undecided between them.

What is asked is compared with what rounding can make of it, magnified by all that magnifies it:

    margin = figure / noise,   yes from `CLEAR` on,   no up to 1,   undecided between.

The noise is a bound, generous by a factor of about 10, so that a figure that is zero has a margin well below 1.
"""

from jaxtyping import Array, Bool, Float

from .._tools._table import AbstractFigures
from .._tools._value import value

CLEAR = 10.0


@value
class Decision(AbstractFigures):
    """A question with three answers. NaN is undecided.

    - `margin`: the figure that decides over what rounding can make of it: yes from 10 on, no up to 1.

    ??? example

        ```python
        decision = rx.factorize(mechanism, state).determinacy
        decision.is_yes, decision.is_no, decision.is_undecided, decision.margin
        ```
    """

    margin: Float[Array, "*batch"]

    @property
    def is_yes(self) -> Bool[Array, "*batch"]:
        """Whether the figure is clearly more than rounding."""
        return self.margin >= CLEAR

    @property
    def is_no(self) -> Bool[Array, "*batch"]:
        """Whether the figure is what rounding can leave of zero."""
        return self.margin <= 1.0

    @property
    def is_undecided(self) -> Bool[Array, "*batch"]:
        """Whether rounding decides."""
        return ~(self.is_yes | self.is_no)
