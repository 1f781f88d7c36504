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
from jax.extend.core import jaxpr_as_fun
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


class OfArrays:
    """A function with arguments of one structure as a program of their arrays, as what else they hold takes a third of
    the time of a short call."""

    def __init__(self, function: Callable[..., PyTree], arguments: tuple[PyTree, ...]):
        with in_little_time(True), of_one_sample(True):
            closed, of_arrays, self.others = eqx.filter_make_jaxpr(function)(*arguments)
        self.structure = jax.tree.structure(of_arrays)
        self.run = jax.jit(functools.wraps(function)(jaxpr_as_fun(closed)), compiler_options=quick_options())

    def __call__(self, arrays: list[PyTree]) -> PyTree:
        return eqx.combine(jax.tree.unflatten(self.structure, self.run(*arrays)), self.others)


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
