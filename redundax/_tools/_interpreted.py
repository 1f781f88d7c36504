"""A traced function computed by NumPy, equation by equation: what runs a few times does not wait for a compiler.

The equations that JAX traces become a list of NumPy's functions, once: calls inside of others are opened, what depends
on no argument is computed at once, and what no result needs is left out. A function with an equation that has no rule
(`_rules`) remains a program. So does, from then on, a loop whose turns have taken half as long as compiling it takes,
one in another too.
"""

import functools
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import cast

import jax
import jax.core
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var
from jax.typing import ArrayLike

from ._compilation import Options
from ._rule import AtPlaces, Computed, Entries, NoRuleError, Parameters, Shapes, clamped
from ._rules import RULES


class Interpreted:
    """The function of NumPy's arrays, one by one, that equations say.

    Loops become programs by `options` of `jax.jit` where those are given; `has_programs` tells whether one has. They
    are added to `loops`; with these options they compile so many `times` as long as in little time. What depends on the
    first `held` arguments alone can be computed once for many others (`holding`).
    """

    def __init__(
        self,
        closed: ClosedJaxpr,
        options: Callable[[], Options] | None = None,
        loops: "list[_Loop] | None" = None,
        times: float = 1.0,
        held: int = 0,
    ):
        if any(isinstance(x, jax.core.Tracer) for x in closed.consts):
            raise NoRuleError
        self._options, self._times, self._loops = options, times, list[_Loop]() if loops is None else loops
        self._values: list[Entries] = []  # those that are known at once, None of others
        self._steps: list[_Step] = []
        self._same: dict[Hashable, list[int]] = {}  # places of what equations give, of which many say the same
        self._large: set[int] = set()  # places of arrays that are let go as soon as no step takes them
        given = [self._place() for _ in closed.jaxpr.invars]
        self._given = len(given)
        self._results = self._opened(closed.jaxpr, closed.consts, given)
        needed, steps = set(self._results), []
        for function, taken, made, _ in reversed(self._steps):
            if needed.intersection(made):
                steps.append((function, taken, made, tuple(k for k in {*taken} - needed if k in self._large)))
                needed.update(taken)
        known, first, self._steps, self._same = {*range(held)}, list[_Step](), list[_Step](), {}
        known.update(k for k, value in enumerate(self._values) if value is not None)
        for step in reversed(steps):
            is_first = known.issuperset(step[1])
            (first if is_first else self._steps).append((*step[:3], ()) if is_first else step)
            known.update(step[2] if is_first else ())
        self._first = first

    @property
    def has_programs(self) -> bool:
        return any(loop.program is not None for loop in self._loops)

    def __call__(self, given: Sequence[Entries]) -> list[np.ndarray]:
        return [np.array(x) for x in self.run(given)]

    def run(self, given: Sequence[Entries]) -> list[Entries]:
        """Arrays that may be those that are given, or parts of them."""
        return self.holding(())(*given)

    def holding(self, held: Sequence[Entries]) -> Callable[..., list[Entries]]:
        """The function of the arguments after the first, which are held."""
        begun, count = self._values.copy(), len(held)
        begun[:count] = held
        _take(self._first, begun)

        def of_others(*given: Entries) -> list[Entries]:
            values = begun.copy()
            values[count : self._given] = given
            _take(self._steps, values)
            return [values[k] for k in self._results]

        return of_others

    def _place(self, value: Entries | None = None) -> int:
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        self._values.append(value)
        return len(self._values) - 1

    def _opened(self, jaxpr: Jaxpr, consts: Sequence[ArrayLike], given: Sequence[int]) -> list[int]:
        """Steps of the equations, and the places of their results."""
        places: dict[Var, int] = dict(zip(jaxpr.invars, given, strict=True))
        places |= {var: self._place(np.array(x)) for var, x in zip(jaxpr.constvars, consts, strict=True)}

        def place(atom: Var | Literal) -> int:
            if not isinstance(atom, Literal):
                return places[atom]
            value = np.array(atom.val, atom.aval.dtype)  # pyright: ignore[reportAttributeAccessIssue]
            return self._once((value.dtype, value.shape, value.tobytes()), lambda: [self._place(value)])[0]

        for equation in jaxpr.eqns:
            made = self._step(equation, [place(atom) for atom in equation.invars])
            places |= dict(zip(equation.outvars, made, strict=True))
        return [place(atom) for atom in jaxpr.outvars]

    def _step(self, equation: JaxprEqn, taken: list[int]) -> list[int]:
        """The places of what an equation gives."""
        name, parameters, count = equation.primitive.name, equation.params, len(equation.outvars)
        if name in _CALLS:
            return self._called(parameters[_CALLS[name]], taken)
        if name == "custom_linear_solve":
            sizes = parameters["const_lengths"]
            first, last = sum(sizes[:2]), sum(sizes[:3])
            return self._called(parameters["jaxprs"].solve, [*taken[first:last], *taken[sum(sizes) :]])
        if name == "cond":
            known = self._values[taken[0]]
            if known is not None:
                return self._called(parameters["branches"][clamped(known, len(parameters["branches"]) - 1)], taken[1:])
            return self._made(self._cond(parameters["branches"]), taken, count)
        if name in _LOOPS:
            return self._made(_Loop(equation, self._options, self._loops, self._times), taken, count)
        if name in _CHANGES_NOTHING:
            return taken
        of, to = (cast(Shapes, [x.aval for x in group]) for group in (equation.invars, equation.outvars))
        if to and all(getattr(x, "dtype", None) == jax.dtypes.float0 for x in to):  # tangents of what has none
            return [self._place(np.zeros(x.shape, x.dtype)) for x in to]
        if name not in RULES:
            raise NoRuleError(name)
        if any(getattr(x, "dtype", None) not in _TYPES for x in (*of, *to)):
            raise NoRuleError
        if name in _RESHAPES and of[0].shape == to[0].shape:
            return taken
        key = name, *taken, *parameters.items(), *((x.dtype, x.shape) for x in to)
        is_large = any(x.size > _LARGE for x in (*of, *to))
        made = self._once(key, lambda: self._ruled(RULES[name](parameters, of, to), taken, count, is_large))
        self._large.update(k for k, x in zip(made, to, strict=True) if x.size > _LARGE)
        return made

    def _ruled(self, rule: Computed | AtPlaces, taken: list[int], count: int, is_large: bool) -> list[int]:
        if not isinstance(rule, AtPlaces):
            return self._made(rule, taken, count)
        array, places, *new = taken
        at = self._made(rule.places, [places], 1)
        self._large.update(at if is_large else ())
        return self._made(rule.function, [array, *at, *new], count)

    def _cond(self, branches: Sequence[ClosedJaxpr]) -> Computed:
        opened = [_Inner(branch, (self._options, self._loops, self._times)) for branch in branches]

        def cond(which: Entries, *given: Entries) -> Entries:
            out = opened[clamped(which, len(opened) - 1)](*given)
            return out[0] if len(out) == 1 else out

        return cond

    def _once(self, key: Hashable, make: Callable[[], list[int]]) -> list[int]:
        try:
            return self._same[key] if key in self._same else self._same.setdefault(key, make())
        except TypeError:  # of parameters that have no hash
            return make()

    def _called(self, inner: ClosedJaxpr | Jaxpr, taken: list[int]) -> list[int]:
        body, held = (inner.jaxpr, inner.consts) if isinstance(inner, ClosedJaxpr) else (inner, ())
        return self._opened(body, held, taken)

    def _made(self, function: Computed, taken: list[int], count: int) -> list[int]:
        """Places of what a step gives, which is computed now if all it takes is known."""
        known = [self._values[k] for k in taken]
        if any(x is None for x in known):
            made = [self._place() for _ in range(count)]
            self._steps.append((function, tuple(taken), tuple(made), ()))
            return made
        with np.errstate(all="ignore"):
            found = function(*known)
        return [self._place(x) for x in ([found] if count == 1 else found)]


# A function, the places of what it takes and makes, and of what is let go after it.
_Step = tuple[Computed, tuple[int, ...], tuple[int, ...], tuple[int, ...]]


def _take(steps: Sequence[_Step], values: list[Entries]) -> None:
    """Each step in turn, which puts what it makes among the values."""
    value = values.__getitem__
    for function, taken, made, last in steps:
        out = function(*map(value, taken))
        if len(made) == 1:
            values[made[0]] = out
        else:
            for k, x in zip(made, out, strict=True):
                values[k] = x
        for k in last:
            values[k] = None


_LARGE = 10_000  # entries, some 80 kB: what is smaller is not worth the time of letting go
_TYPES = {*map(np.dtype, ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"))}
_TYPES |= {*map(np.dtype, ("float32", "float64"))}
_CALLS = {  # the parameter that holds the equations of a call
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "closed_call": "call_jaxpr",
    "core_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "custom_vmap_call": "call",
    "remat2": "jaxpr",
}
_CHANGES_NOTHING = {"nonbatchable", "stop_gradient"}
_RESHAPES = {"broadcast_in_dim", "expand_dims", "squeeze"}
_BEGINNING, _COMPILING = 0.15, 4e-4  # seconds of CPU that a program takes, and an equation of it


class _Inner:
    """Equations inside of others, opened when they are first asked for."""

    def __init__(self, closed: ClosedJaxpr, inside: "Inside", held: int = 0):
        self._open, self._opened = functools.partial(Interpreted, closed, *inside, held=held), None

    def __call__(self, *given: Entries) -> list[Entries]:
        return self.holding(())(*given)

    def holding(self, held: Sequence[Entries]) -> Callable[..., list[Entries]]:
        if self._opened is None:
            self._opened = self._open()
        return self._opened.holding(held)


class _Loop:
    """A loop, which is a program once its turns have taken half as long as compiling it takes; as long, where it is
    nearly at its end. What took long before a loop in it became a program does not count."""

    def __init__(self, equation: JaxprEqn, options: Callable[[], Options] | None, loops: "list[_Loop]", times: float):
        self._equation, self._options, self._loops = equation, options, loops
        self._turns = _LOOPS[equation.primitive.name](equation.params, (options, loops, times))
        self._most = np.inf if options is None else times * (_BEGINNING + _COMPILING * count(equation))  # seconds
        self._left, self._begun = self._most, np.inf  # the time that its turns began, if it is in one
        self._is_open = False  # what its first turn does once does not count
        self.program: Computed | None = None
        loops.append(self)

    def __call__(self, *given: Entries) -> Entries:
        out = self._compiled(given) if self.program is not None else self._turned(given)
        return out[0] if len(out) == 1 else out

    def _turned(self, given: Sequence[Entries]) -> Sequence[Entries]:
        self._begun = time.thread_time()
        for onward, out, done in self._turns(given):
            if not self._is_open:
                self._is_open, self._begun = True, time.thread_time()
            spent = time.thread_time() - self._begun
            if out is not None:
                self._left, self._begun = self._left - spent, np.inf
                return out
            if spent > self._left * done:
                return self._compiled(onward)
        raise AssertionError

    def _compiled(self, given: Sequence[Entries]) -> list[np.ndarray]:
        if self.program is not None:
            return [np.asarray(x) for x in self.program(*given)]
        equation, options = self._equation, None if self._options is None else self._options()
        bound = functools.partial(equation.primitive.bind, **equation.params)
        self.program, self._begun = jax.jit(bound, compiler_options=options), np.inf
        out = self._compiled(given)
        for loop in self._loops:
            loop.begin_anew()
        return out

    def begin_anew(self) -> None:
        """Count its turns from here on, if it is in one."""
        if self._begun < np.inf:
            self._left, self._begun = self._most, time.thread_time()


# What equations inside of others are interpreted with: options, loops and times of these.
Inside = tuple[Callable[[], Options] | None, list[_Loop], float]
# What a loop is given to go on from here, turn by turn; what it gives at its end; and the part that is done, one half
# if nobody knows or it is less.
Turns = Iterator[tuple[Sequence[Entries], Sequence[Entries] | None, float]]


def _while(parameters: Parameters, inside: Inside) -> Callable[[Sequence[Entries]], Turns]:
    first, more = parameters["cond_nconsts"], parameters["body_nconsts"]
    going = _Inner(parameters["cond_jaxpr"], inside, held=first)
    body = _Inner(parameters["body_jaxpr"], inside, held=more)

    def turns(given: Sequence[Entries]) -> Turns:
        held, now = given[: first + more], given[first + more :]
        goes_on, turned = going.holding(held[:first]), None
        while np.any(flag := goes_on(*now)[0]):
            turned = turned or body.holding(held[first:])
            new = turned(*now)
            now = new if np.ndim(flag) == 0 else [_chosen(flag, *both) for both in zip(new, now, strict=True)]
            yield (*held, *now), None, 0.5
        yield given, now, 1.0

    return turns


def _chosen(flag: Entries, yes: Entries, no: Entries) -> np.ndarray:
    """Of a batch what goes on, and what has ended as it is."""
    return np.where(np.reshape(flag, np.shape(flag) + (1,) * (np.ndim(yes) - np.ndim(flag))), yes, no)


def _scan(parameters: Parameters, inside: Inside) -> Callable[[Sequence[Entries]], Turns]:
    if "ft_in" in parameters:  # newer JAX
        first, number, _ = map(len, parameters["ft_in"].unpack())
    else:
        first, number = parameters["num_consts"], parameters["num_carry"]
    body, length, last = _Inner(parameters["jaxpr"], inside, held=first), parameters["length"], first + number
    if not length:
        raise NoRuleError

    def turns(given: Sequence[Entries]) -> Turns:
        turned, now, over = body.holding(given[:first]), given[first:last], given[last:]
        noted: list[Sequence[Entries]] = []
        for k in reversed(range(length)) if parameters["reverse"] else range(length):
            out = turned(*now, *[x[k] for x in over])
            now = out[:number]
            noted.append(out[number:])
            yield given, None, max(0.5, len(noted) / length)  # of phases of a motion few turn at all
        if parameters["reverse"]:
            noted.reverse()
        yield given, [*now, *(np.stack(each) for each in zip(*noted, strict=True))], 1.0

    return turns


_LOOPS = {"while": _while, "scan": _scan}


def count(inside: object) -> int:
    """Of equations in what holds some."""
    if isinstance(inside, ClosedJaxpr):
        inside = inside.jaxpr
    if isinstance(inside, Jaxpr):
        return count(inside.eqns)
    if isinstance(inside, JaxprEqn):
        return 1 + sum(map(count, inside.params.values()))
    return sum(map(count, inside)) if isinstance(inside, tuple | list) else 0
