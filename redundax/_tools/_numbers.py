"""Known numbers are computed, not compiled: functions that run on NumPy's arrays and are traced with JAX's.

`xp` has the functions of both. Each looks at its arguments: of NumPy's arrays and Python's numbers alone it is NumPy's
and gives NumPy's, of any array of JAX it is JAX's. So one text of an equation serves a call on known numbers, whose
arguments its entry (`on_numbers`) has turned into NumPy's, and a program, in which they are traced. What is the model's
(`of_model`), that a user writes for JAX, is traced by itself where numbers are known: NumPy computes its equations
(`_interpreted`) the first times, and a program from then on.

A batch of samples on numbers has axes for them in front, as `vmap` gives it to what is traced: `product`, `solution`,
`chosen_of` and `while_loop` take both.

`Array`, or `Numeric`, in annotations stands for either. Here alone stands what differs: loops, branches, entries set,
derivatives given by hand, factors that do not exist.
"""

import collections
import contextlib
import functools
import inspect
import itertools
import operator
import time
from collections.abc import Callable, Hashable, Iterable
from functools import partial
from types import ModuleType
from typing import Any, Generic, NamedTuple, ParamSpec, TypeAlias, TypeVar

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jax.typing import DTypeLike
from jaxtyping import Array, PyTree

from ._compilation import OfArrays, compiled, in_little_time, of_equations, of_one_sample, quick_options, uncollected
from ._computing import computing, is_computing
from ._interpreted import Interpreted, count
from ._value import flattened, is_model

P = ParamSpec("P")
T = TypeVar("T")
S = TypeVar("S")
Rule = TypeVar("Rule", bound=Callable[..., tuple])

Numeric: TypeAlias = Any  # arrays of NumPy or of JAX: a type checker knows no type of both

_SEQUENCE, _OF_JAX, _TRACED, _PLAIN, _OF_MODEL, _OTHER = range(6)


class _Kinds(dict[type, int]):
    """Kinds of types, as JAX's own checks take longer."""

    def __missing__(self, own: type) -> int:
        if issubclass(own, jax.core.Tracer):
            kind = _TRACED
        elif issubclass(own, jax.Array):
            kind = _OF_JAX
        elif issubclass(own, list | tuple):
            kind = _SEQUENCE
        elif getattr(own, "is_model", False):
            kind = _OF_MODEL
        else:
            kind = _PLAIN if issubclass(own, np.ndarray | np.generic | float | int | str | None) else _OTHER
        return self.setdefault(own, kind)


_kinds = _Kinds()


def is_number(x: PyTree) -> bool:
    """Whether it is no array of JAX, nor a list or tuple of such."""
    kind = _kinds[type(x)]
    return all(map(is_number, x)) if kind == _SEQUENCE else kind >= _PLAIN


def are_numbers(*trees: PyTree) -> bool:
    """Whether no leaf is an array of JAX, but for those of a model, of which none is traced."""
    return _hold(trees, _PLAIN)


def are_known(*trees: PyTree) -> bool:
    """Whether no leaf is traced."""
    return _hold(trees, _PLAIN, _OF_JAX)


def _hold(trees: Iterable[PyTree], *kinds: int) -> bool:
    """Whether all leaves are of these kinds, those of a model known."""
    for x in trees:
        kind = _kinds[type(x)]
        if kind in kinds or (kind == _OF_MODEL and x.is_known) or (kind == _SEQUENCE and _hold(x, *kinds)):
            continue
        leaves = jax.tree.leaves(x, is_leaf=is_model) if kind == _OTHER else [x]
        is_leaf = len(leaves) == 1 and leaves[0] is x
        if kind != _OTHER or not (is_leaf or _hold(leaves, *kinds)):
            return False
    return True


def tolerance_of(tolerance: tuple[float, float], like: Numeric) -> float:
    """A tolerance, at least so many roundings."""
    return max(tolerance[0], tolerance[1] * float(jnp.finfo(like.dtype).eps))


# What NumPy refuses and JAX answers ----------------------------------------------------------------------


def _default_float() -> np.dtype:
    return np.dtype(np.float64 if jax.config.jax_enable_x64 else np.float32)  # pyright: ignore


def _made(function: Callable[..., np.ndarray], place: int) -> Callable[..., np.ndarray]:
    """A function that makes an array, in JAX's default precision where none is given at the `place`."""

    def run(*arguments: object, **named: object) -> np.ndarray:
        if len(arguments) <= place and named.get("dtype") is None:
            named["dtype"] = _default_float()
        return function(*arguments, **named)

    return run


def _asarray(x: object, dtype: DTypeLike | None = None) -> np.ndarray:
    if dtype is None and not isinstance(x, np.ndarray | np.generic):
        array = np.asarray(x)
        return array.astype(_default_float()) if array.dtype == np.float64 else array
    return np.asarray(x, dtype)


def _full(shape: int | tuple[int, ...], value: Numeric, dtype: DTypeLike | None = None) -> np.ndarray:
    return np.full(shape, value, _asarray(value).dtype if dtype is None else dtype)


def _or_nan(function: Callable[..., T], none: Callable[..., T]) -> Callable[..., T]:
    """NaN where LAPACK finds no factor, as JAX gives it."""

    @functools.wraps(function)
    def run(a: np.ndarray, *more: object, **named: object) -> T:
        try:
            return function(a, *more, **named)
        except np.linalg.LinAlgError:
            return none(a, *more, **named)

    return run


def _no_svd(a: np.ndarray, full_matrices: bool = True, compute_uv: bool = True) -> np.ndarray | tuple[np.ndarray, ...]:
    (m, n), s = a.shape, min(a.shape)
    shapes = ((m, m if full_matrices else s), (s,), (n if full_matrices else s, n))
    found = tuple(np.full(shape, np.nan, a.dtype) for shape in shapes)
    return found if compute_uv else found[1]


def _each_solved(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Infinite where there is no factor, the others of a batch as they are."""
    if a.ndim == 2:
        return np.full_like(b, np.inf)
    batch = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    many, rights = (np.broadcast_to(x, batch + x.shape[-2:]) for x in (a, b))
    out = np.empty(rights.shape, b.dtype)
    for place in np.ndindex(batch):
        out[place] = xp.linalg.solve(many[place], rights[place])
    return out


def _nan_like(a: np.ndarray, *_: object) -> np.ndarray:
    return np.full_like(a, np.nan)


_OF_NUMPY = {
    "zeros": _made(np.zeros, 1),
    "ones": _made(np.ones, 1),
    "eye": _made(np.eye, 3),
    "linspace": _made(np.linspace, 5),
    "full": _full,
    "asarray": _asarray,
    "array": _asarray,
    "unstack": lambda x, axis=0: tuple(np.moveaxis(x, axis, 0)),
    "svd": _or_nan(np.linalg.svd, _no_svd),
    "cholesky": _or_nan(np.linalg.cholesky, _nan_like),
    "inv": _or_nan(np.linalg.inv, _nan_like),
    "pinv": _or_nan(np.linalg.pinv, lambda a, **_: _nan_like(a)),
    "solve": _or_nan(np.linalg.solve, _each_solved),
    "eigh": _or_nan(np.linalg.eigh, lambda a: (np.full(len(a), np.nan, a.dtype), _nan_like(a))),
    "eigvalsh": _or_nan(np.linalg.eigvalsh, lambda a: np.full(len(a), np.nan, a.dtype)),
}


class _Namespace:
    """The functions of two modules by the kind of their arguments."""

    def __init__(self, of_numbers: ModuleType, traced: ModuleType):
        self._of_numbers, self._traced = of_numbers, traced

    def __getattr__(self, name: str) -> Any:  # once for each name
        one, two = _OF_NUMPY.get(name) or getattr(self._of_numbers, name), getattr(self._traced, name)
        if isinstance(one, type) or not callable(one):  # types and constants
            found = one
        else:

            def found(*arguments: object, **named: object) -> PyTree:
                for x in arguments:
                    if _kinds[type(x)] < _PLAIN and not is_number(x):
                        return two(*arguments, **named)
                if named and not all(map(is_number, named.values())):
                    return two(*arguments, **named)
                return one(*arguments, **named)

        setattr(self, name, found)
        return found


xp: Any = _Namespace(np, jnp)
xp.linalg = _Namespace(np.linalg, jnp.linalg)


# What both have in other words ---------------------------------------------------------------------------


def while_loop(going: Callable[[T], Numeric], body: Callable[[T], T], start: T) -> T:
    """`jax.lax.while_loop`; in a batch of numbers what has ended stays, as under `vmap`."""
    if not are_numbers(start):
        return jax.lax.while_loop(going, body, start)
    while np.any(flag := going(start)):
        start = body(start) if np.ndim(flag) == 0 else chosen_of(flag, body(start), start)
    return start


def chosen_of(flag: Numeric, yes: T, no: T) -> T:
    """`where` of a flag for each sample of a batch, or of one, and all arrays of two trees, with axes behind."""

    def chosen(yes: Numeric, no: Numeric) -> Numeric:
        behind = max(np.ndim(yes), np.ndim(no)) - np.ndim(flag)
        return xp.where(xp.reshape(flag, np.shape(flag) + (1,) * behind) if np.ndim(flag) else flag, yes, no)

    return jax.tree.map(chosen, yes, no)


def or_one(size: Numeric) -> Numeric:
    """Sizes to divide by: 1 where there is none."""
    return xp.where(size > 0, size, 1.0)


def product(matrix: Numeric, vector: Numeric) -> Numeric:
    """matrix @ vector, sample by sample where axes for them stand in front."""
    return matrix @ vector if vector.ndim == 1 else (matrix @ vector[..., None])[..., 0]


def solution(matrix: Numeric, vector: Numeric) -> Numeric:
    """matrix^-1 vector, in the same way."""
    if vector.ndim == 1:
        return xp.linalg.solve(matrix, vector)
    return xp.linalg.solve(matrix, vector[..., None])[..., 0]


def fori_loop(first: int, last: int, body: Callable[[Numeric, T], T], start: T) -> T:
    """`jax.lax.fori_loop`."""
    if not are_numbers(start):
        return jax.lax.fori_loop(first, last, body, start)
    for k in range(first, last):
        start = body(k, start)
    return start


def scan(body: Callable[[T, Numeric], tuple[T, S]], start: T, places: np.ndarray) -> tuple[T, list[S]]:
    """`jax.lax.scan`, and what each turn gives, in a list."""
    if not are_numbers(start):
        end, stacked = jax.lax.scan(body, start, jnp.asarray(places))
        return end, [jax.tree.map(lambda x, k=k: x[k], stacked) for k in range(len(places))]
    given = []
    for place in places:
        start, own = body(start, place)
        given.append(own)
    return start, given


def cond(flag: Numeric, yes: Callable[..., T], no: Callable[..., T], *operands: PyTree) -> T:
    """`jax.lax.cond`."""
    if not is_number(flag):
        return jax.lax.cond(flag, yes, no, *operands)
    return (yes if flag else no)(*operands)


def each(function: Callable[[Numeric], Numeric], samples: Numeric) -> Numeric:
    """A function of one array for every one along the first axis: `jax.vmap`."""
    first = function(samples[0]) if is_number(samples) and len(samples) else None
    if first is None or not is_number(first):  # of traced samples, or of what the function holds
        return jax.vmap(function)(samples)
    return np.stack([first, *map(function, samples[1:])])


def stop_gradient(tree: T) -> T:
    """The same without derivatives; known numbers stay what they are."""
    if are_known(tree):
        return tree
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if isinstance(x, jax.core.Tracer) else x, tree)


def entries_set(x: Numeric, places: Numeric, values: Numeric) -> Numeric:
    """x with entries set."""
    if not (is_number(x) and is_number(values) and is_number(places)):
        return jnp.asarray(x).at[places].set(values)
    x = np.array(x)
    x[places] = values
    return x


def take(x: Numeric, places: Numeric) -> Numeric:
    """x[places], of known entries at places that are traced too."""
    return x[places] if is_number(places) else jnp.asarray(x)[places]


def cholesky(a: Numeric) -> Numeric:
    """The lower factor of a symmetric matrix, of which its lower triangle is read."""
    return xp.linalg.cholesky(a) if is_number(a) else jnp.linalg.cholesky(a, symmetrize_input=False)


def solve_triangular(a: Numeric, b: Numeric, *, lower: bool) -> Numeric:
    """`jax.scipy.linalg.solve_triangular`."""
    if not (is_number(a) and is_number(b)):
        return jax.scipy.linalg.solve_triangular(a, b, lower=lower)
    return xp.linalg.solve(a, b) if np.all(np.isfinite(a)) else np.full_like(b, np.nan)


class custom_jvp(Generic[P, T]):
    """A function with a derivative given by hand, which numbers do not ask for; `make` is JAX's or Equinox's."""

    def __init__(
        self, function: Callable[P, T], make: type[jax.custom_jvp] | type[eqx.filter_custom_jvp] = jax.custom_jvp
    ):
        self.function, self.traced = function, make(function)
        functools.update_wrapper(self, function)

    def defjvp(self, rule: Rule) -> Rule:
        """Gives the derivative."""
        (getattr(self.traced, "def_jvp", None) or self.traced.defjvp)(rule)
        return rule

    def_jvp = defjvp

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> T:
        known = are_numbers(*arguments, *named.values())
        return (self.function if known else self.traced)(*arguments, **named)


# Entries ---------------------------------------------------------------------------------------------------


def known(x: Numeric) -> Numeric:
    """NumPy's array of one that is not traced."""
    return x if isinstance(x, jax.core.Tracer) else np.asarray(x)


def as_numbers(tree: T) -> T:
    """JAX's arrays as NumPy's, but for those of a model."""
    if type(tree) is tuple:
        return tuple(map(as_numbers, tree))  # pyright: ignore[reportReturnType]
    if are_numbers(tree):
        return tree
    return jax.tree.map(lambda x: known(x) if isinstance(x, jax.Array) else x, tree, is_leaf=is_model)


# Calls with arrays of the same shapes after which a program puts them on the device, in a fifth of the time; compiling
# it takes as long as some fifty of them.
OFTEN_PUT = 50
_put = collections.Counter[int]()
_by_program = jax.jit(lambda *arrays: arrays)


def as_arrays(tree: T) -> T:
    """NumPy's arrays as JAX's, at once, even where something else is traced."""
    leaves, structure = jax.tree.flatten(tree)
    places = [k for k, x in enumerate(leaves) if isinstance(x, np.ndarray | np.generic)]
    given = [np.asarray(leaves[k]) for k in places]
    _put[key := hash(tuple((x.dtype, x.shape) for x in given))] += 1
    often = _put[key] > OFTEN_PUT and not (jax.config.jax_disable_jit or jax.config.jax_debug_nans)  # pyright: ignore[reportAttributeAccessIssue]
    with jax.core.eval_context():
        for k, x in zip(places, _by_program(*given) if often else jax.device_put(given), strict=True):
            leaves[k] = x
    return jax.tree.unflatten(structure, leaves)


# Calls of one structure after which a program takes over, which compiles for as long as a few hundred take.
OFTEN = 300


def on_numbers(
    function: Callable[P, T],
    *,
    jit: bool = True,
    repeats: bool = False,
    traced: Callable[[Callable[P, T]], Callable[P, T]] | None = None,
) -> Callable[P, T]:
    """A function that runs on NumPy's arrays where all its arguments are known, and gives JAX's; else it is traced.

    One that `repeats` is a program of its own from call `OFTEN` on with arguments of one structure; `traced`
    compiles it where arguments are, `once` or `once_in_reverse` (`_derivatives`) in little time for a derivative alone.
    """
    inside = (traced or eqx.filter_jit)(function) if jit else function
    calls, recent = collections.Counter[int](), collections.OrderedDict[Hashable, OfArrays]()

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        given = *arguments, *named.values()
        numbers = are_numbers(*given)
        if not (numbers or are_known(*given)):
            return inside(*arguments, **named)
        within = is_computing()
        if repeats and not named:  # their order is that of the call
            arrays, kind = flattened(arguments)
            calls[key := hash(kind)] += 1
            if calls[key] > OFTEN:
                try:
                    with jax.core.eval_context():
                        out = _kept(recent, kind, lambda: OfArrays(function, arguments))(arrays)
                except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
                    return inside(*arguments, **named)
                return as_numbers(out) if within else out
        if within and numbers:
            return function(*arguments, **named)
        with computing():
            out = function(*as_numbers(arguments), **as_numbers(named))
        return out if within else as_arrays(out)

    return run


def asked_of_model(function: Callable[P, T]) -> Callable[P, T]:
    """`of_model` for what users ask of a model themselves: it gives JAX's arrays of NumPy's, too."""
    return on_numbers(of_model(function), jit=False)


def computed(function: Callable[P, T]) -> Callable[P, T]:
    """`on_numbers` for a call that no program holds."""
    return on_numbers(function, jit=False)


# Calls of one structure in which NumPy computes the model; compiling a program takes as long as some hundred of them.
FEW = 100
_RECENT = 128  # structures of which one function is kept traced


class Kind(NamedTuple):
    """What is traced, which decides how it is compiled, and when programs take over from NumPy."""

    loops: bool = True  # it has some that turn often, and become programs of their own
    is_single: bool = True  # it is traced as one sample
    times: float = 1.0  # how long an equation compiles, by that of a value in little time
    is_large: bool = False  # it is compiled in order and with all optimisation


_MODEL, STEPS = Kind(loops=False, is_single=False), Kind()
LARGE, FORWARD, REVERSE = Kind(times=4.0, is_large=True), Kind(is_single=False), Kind(is_single=False)


class _Traced:
    """A function with arguments of one structure: computed by NumPy at first, by a program from call `FEW` on."""

    def __init__(self, function: Callable[..., PyTree], arguments: tuple[PyTree, ...], kind: Kind):
        with in_little_time(True), of_equations(not kind.loops), of_one_sample(kind.is_single), uncollected():
            self.closed, of_arrays, self.others = eqx.filter_make_jaxpr(function)(*arguments)
        self.function, self.structure, self.calls = function, jax.tree.structure(of_arrays), 0
        self.first, self.loops, self.repeats = None, kind.loops, kind == STEPS
        of_jax = (isinstance(x, jax.Array) for x in jax.tree.leaves(arguments) if eqx.is_array(x))
        self.held = sum(itertools.takewhile(bool, of_jax))  # arrays of the model, in front
        self.is_mixed = bool(jax.tree.leaves(self.others))  # it gives more than arrays
        self.last: tuple[list[Array], Callable[..., list[Numeric]] | None] = [], None
        self.spent = 0.0  # seconds of CPU in programs, of what repeats
        self.options = partial(quick_options, True, True) if kind.is_large else quick_options  # asked for as it is kept
        with contextlib.suppress(Exception):  # functions of a user may hold what NumPy has not
            self.first = Interpreted(self.closed, self.options, times=kind.times, held=self.held)

    @property
    def is_compiled(self) -> bool:
        """Whether it, or a loop of it, is a program."""
        return "program" in vars(self) or (self.first is not None and self.first.has_programs)

    @property
    def runs_long(self) -> bool:
        """Whether its programs have run for as long as one with all optimisation compiles."""
        return self.spent > LONG and self.spent > LONG * self._size

    @functools.cached_property
    def _size(self) -> float:
        return count(self.closed) / _USUAL

    @functools.cached_property
    def program(self) -> Callable[..., list[Array]]:
        run = functools.wraps(self.function)(jaxpr_as_fun(self.closed))
        return jax.jit(run, compiler_options=self.options())

    def __call__(self, given: list[Numeric]) -> PyTree:
        self.calls += 1
        out, timed = None, self.repeats and self.is_compiled
        begun = time.process_time() if timed else 0.0
        if self.first is not None and (self.calls <= FEW or (self.loops and self.first.has_programs)):
            with contextlib.suppress(Exception):
                out = self._computed(self.first, given)
        if out is None:
            self.first = None
            out = [np.asarray(x) for x in self.program(*given)]
        if timed:
            self.spent += time.process_time() - begun
        made = jax.tree.unflatten(self.structure, out)
        return eqx.combine(made, self.others) if self.is_mixed else made

    def _computed(self, first: Interpreted, given: list[Numeric]) -> list[np.ndarray]:
        """By NumPy; what depends on the model alone once, as long as that is the same."""
        model, others = given[: self.held], given[self.held :]
        last, run = self.last
        if run is None or not all(map(operator.is_, model, last)):
            run = first.holding([np.asarray(x) for x in model])
            if all(isinstance(x, jax.Array) for x in model):  # NumPy's may change
                self.last = model, run
        return [np.array(x) for x in run(*[np.asarray(x) for x in others])]


# Seconds of CPU that programs have run in all, by calls of one structure, when one with all optimisation takes over; of
# up to so many equations, in proportion of more: that of 12,300 compiled for 6 s, of 39,700 for 26 s.
LONG, _USUAL = 5.0, 8000


def as_program(
    function: Callable[..., T], kind: Kind = STEPS, traced: Callable[..., Callable[..., T]] | None = None
) -> Callable[..., T]:
    """What repeats a thousand times: `compiled` where arguments are traced, or by `traced` as in `on_numbers`; of
    numbers, or JAX's arrays, it gives such.

    It is computed by NumPy at first, its loops or all of it are compiled in little time where that would take longer,
    and with all optimisation once they have run for `LONG`. What is `LARGE`, and one call of which may run for long, is
    compiled with all optimisation as soon as it would take longer. Derivatives, `FORWARD` and
    `REVERSE`, which would take minutes, never are.
    """
    first, fast = (traced or compiled)(function), compiled(function, runs_long=True)
    recent: collections.OrderedDict[Hashable, _Traced] = collections.OrderedDict()

    @functools.wraps(function)
    def run(*arguments: PyTree) -> T:
        if not are_known(*arguments):
            return first(*arguments)
        if not are_numbers(*arguments):
            with computing():
                return as_arrays(run(*as_numbers(arguments)))
        arrays, key = flattened(arguments)
        try:
            with jax.core.eval_context():
                own = _kept(recent, key, lambda: _Traced(function, arguments, kind))
                if kind != STEPS or not own.runs_long:
                    return own(arrays)
        except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
            return as_numbers(first(*arguments))
        return as_numbers(fast(*arguments))

    return run


def _kept(recent: collections.OrderedDict[Hashable, T], key: Hashable, make: Callable[[], T]) -> T:
    """What was made last for keys, and in the precision that JAX has now."""
    key = jax.config.jax_enable_x64, key  # pyright: ignore[reportAttributeAccessIssue]
    if key not in recent:
        recent[key] = make()
        if len(recent) > _RECENT:
            recent.popitem(last=False)
    return recent[key]


def of_model(function: Callable[P, T]) -> Callable[P, T]:
    """What of a model is traced by itself where numbers are known, and part of a program where some are traced; of
    arrays of JAX it gives such."""
    recent: collections.OrderedDict[Hashable, _Traced] = collections.OrderedDict()

    def computed(*arguments: PyTree) -> T:
        arrays, key = flattened(arguments)
        return _kept(recent, key, lambda: _Traced(function, arguments, _MODEL))(arrays)

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        numbers = are_numbers(*arguments, *named.values())
        if not (numbers or are_known(*arguments, *named.values())):
            return function(*arguments, **named)
        given = inspect.signature(function).bind(*arguments, **named).args if named else arguments
        try:
            with jax.core.eval_context():
                if numbers:
                    return computed(*given)
                with computing():
                    out = computed(*as_numbers(given))
                return as_arrays(out)
        except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
            return function(*arguments, **named)

    return run
