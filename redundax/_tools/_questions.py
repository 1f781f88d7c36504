"""Questions about known numbers, which no program holds."""

import functools
import inspect
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from ._errors import RedundaxError
from ._numbers import are_known, computed

P = ParamSpec("P")
T = TypeVar("T")


def question(function: Callable[P, T]) -> Callable[P, T]:
    """`computed` for a call whose answer depends on decisions, so that traced numbers are refused."""
    signature, answer = inspect.signature(function), computed(function)

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        if not are_known((arguments, named)):
            given = signature.bind(*arguments, **named).arguments
            traced = next(name for name, value in given.items() if not are_known(value))
            own = function.__name__
            raise RedundaxError(
                f"Argument `{traced}` must hold known numbers, but they are traced by `jit`, `vmap` or `grad`. Call "
                f"`{own}` outside of these, state by state, or take differences of it; `solve` may stand inside."
            )
        return answer(*arguments, **named)

    return run
