"""How programs are compiled: in little time outside transformations, with all optimisation inside them.

A call whose numbers are all there runs few times, and compiling it takes thousands of times as long as running it. What
of it is a program (`_numbers`: the model; large mechanisms, motions, searches; what is asked often) is compiled without
optimisation, and at once, even where a `vmap` or `jit` around it traces something else: what does not depend on traced
numbers is not traced again for them. Such a program of a single sample has one way to go; what stands ready for batches
and derivatives is left out of it.
"""

import contextlib
import functools
import gc
from collections.abc import Callable, Iterator
from typing import ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
from jaxtyping import PyTree

from ._waiting import tell_of_long_compiling

P = ParamSpec("P")
T = TypeVar("T")

Options = dict[str, bool | int | str]

# LAPACK calls side by side can wait for good on few cores, and small ones take longer for the change of threads.
_IN_ORDER: Options = {"xla_cpu_scheduler_type": "CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED"}
_LIGHT: Options = {**_IN_ORDER, "xla_cpu_use_fusion_emitters": False}  # the older code generator
_QUICK: Options = {
    **_LIGHT,
    "xla_backend_optimization_level": 0,
    "xla_cpu_parallel_codegen_split_count": 4,  # each part costs as much as what stands in it
    "xla_llvm_disable_expensive_passes": True,
    # What loops repeat is little; to look for it takes a third of the time that a motion's step takes to compile. What
    # reshapes could be moved past takes a twentieth.
    "xla_disable_hlo_passes": "simplify-while-loops,while-loop-invariant-code-motion,"
    "while-loop-expensive-invariant-code-motion,reshape-mover",
}

tell_of_long_compiling()
# Parts of what JAX knows programs by.
of_one_sample, in_little_time, of_equations = (jax.make_user_context(False) for _ in range(3))


def is_single() -> bool:
    """Whether what is traced is the program of a call outside transformations, with no batch around it."""
    return of_one_sample.value


def is_quick() -> bool:
    """Whether what is traced is compiled in little time: the less there is of it the better, as nothing is fused."""
    return in_little_time.value


def is_loopless() -> bool:
    """Whether few entries are better summed than taken or added: XLA makes a loop of each gather and scatter, whose
    turns take microseconds. NumPy, which computes equation by equation, does not."""
    return in_little_time.value and not of_equations.value


@contextlib.contextmanager
def uncollected() -> Iterator[None]:
    """Without search for garbage, which takes a fifth of the time that tracing takes and finds nothing in it."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def compiled(function: Callable[P, T], *, runs_long: bool = False, in_order: bool = False) -> Callable[P, T]:
    """`eqx.filter_jit`, compiled in little time and run at once where no argument is traced.

    One that `runs_long`, such as a motion, is optimised all the same, by the code generator that takes less time: the
    older one, but for large programs, which run `in_order`.
    """
    inside = eqx.filter_jit(function)

    @functools.cache
    def outside() -> Callable[P, T]:
        options = quick_options(runs_long, in_order)
        return eqx.filter_jit(function, compiler_options=options)  # pyright: ignore[reportCallIssue]

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        if any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves((arguments, named))):
            return inside(*arguments, **named)
        try:
            with jax.core.eval_context(), of_one_sample(True), in_little_time(not runs_long):
                return outside()(*arguments, **named)
        except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
            return inside(*arguments, **named)

    return run


def is_staged() -> bool:
    """Whether this is traced as a part of a program, and not for a derivative or a batch alone."""
    return isinstance(jnp.zeros(()) + 1, jax.core.Tracer)


def once(function: Callable[P, T]) -> Callable[P, T]:
    """`eqx.filter_jit` of what is traced, compiled in little time where no program is around it: a derivative that is
    asked for once waits for its compiling alone. For forward mode."""
    inside = eqx.filter_jit(function)

    @functools.cache
    def alone() -> Callable[P, T]:
        return eqx.filter_jit(function, compiler_options=quick_options())  # pyright: ignore[reportCallIssue]

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        if is_staged():
            return inside(*arguments, **named)
        with in_little_time(True):
            return alone()(*arguments, **named)

    return run


def once_in_reverse(function: Callable[..., T]) -> Callable[..., T]:
    """The same for reverse mode: JAX takes options for no program that it cuts in two, so that going forth and back are
    programs of their own here."""
    inside = eqx.filter_jit(function)

    @functools.cache
    def ways(is_alone: bool) -> tuple[Callable[..., PyTree], ...]:
        options, both = quick_options() if is_alone else None, (functools.partial(_forth, function), _back)
        return tuple(eqx.filter_jit(way, compiler_options=options) for way in both)  # pyright: ignore[reportCallIssue]

    def gone(way: int, *given: PyTree) -> PyTree:
        is_alone = not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(given))  # no other derivative around
        with in_little_time(is_alone):
            return ways(is_alone)[way](*given)

    @eqx.filter_custom_vjp
    def differentiated(given: tuple[PyTree, PyTree]) -> PyTree:
        return inside(*given[0], **given[1])

    @differentiated.def_fwd
    def _forward(perturbed: PyTree, given: PyTree) -> PyTree:
        return gone(0, *eqx.partition(given, perturbed))

    @differentiated.def_bwd
    def _backward(residuals: PyTree, grad: PyTree, perturbed: PyTree, given: PyTree) -> PyTree:
        return gone(1, residuals, grad)

    @functools.wraps(function)
    def run(*arguments: PyTree, **named: PyTree) -> T:
        if is_staged():
            return inside(*arguments, **named)
        try:
            return differentiated((arguments, named))
        except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
            return inside(*arguments, **named)

    return run


def _forth(function: Callable[..., PyTree], moved: PyTree, fixed: PyTree) -> tuple[PyTree, PyTree]:
    """Values, and what takes their cotangents back to those of what is moved."""

    def of_moved(moved: PyTree) -> PyTree:
        arguments, named = eqx.combine(moved, fixed)
        return function(*arguments, **named)

    out, back = eqx.filter_vjp(of_moved, moved)
    return out, (jax.eval_shape(lambda: eqx.filter(out, eqx.is_inexact_array)), back)


def _back(residuals: tuple[PyTree, Callable[..., PyTree]], grad: PyTree) -> PyTree:
    """Cotangents of what is moved; of results that are not asked for, None, they are 0."""
    like, back = residuals

    def whole(x: PyTree, like: PyTree) -> PyTree:
        return x if x is not None or like is None else jnp.zeros(like.shape, like.dtype)

    return back(jax.tree.map(whole, grad, like, is_leaf=lambda x: x is None))[0]


@functools.cache
def quick_options(runs_long: bool = False, large: bool = False) -> Options:
    """Options of `jax.jit`, as far as this XLA knows them; none but for CPUs."""
    options = _IN_ORDER if large else _LIGHT if runs_long else _QUICK
    if jax.default_backend() != "cpu":
        return {}
    if _are_known(options):
        return options
    return {name: value for name, value in options.items() if _are_known({name: value})}


def _are_known(options: Options) -> bool:
    try:
        jax.jit(lambda: 0, compiler_options=options).lower().compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True
