"""A hard case: exact parameters, what becomes of them, and the exact answers with their bounds."""

import dataclasses
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
from mpmath import mp
from truth import exact, friction
from truth.exact import exactly
from truth.scenes import Parameters

from ._linear import Linear

Exact = exact.Mechanism | Linear
Builder = Callable[[Parameters], Exact | None]
Answer = Mapping[str, np.ndarray]  # part ("acceleration", "multipliers", "friction") -> entries
PARTS = ("acceleration", "multipliers", "friction")


@dataclass(frozen=True, eq=False)
class Case:
    """One mechanism in one state.

    - `family`, `name`: where it stands in the report.
    - `build`, `parameters`: exact data; closures take `compliance` and `misfit` from the parameters too.
    - `routes`: names of the routes that it runs on.
    - `friction`: whether joints rub.
    - `disturb`: what the library is given instead of the exact mechanism: a state off the manifold, drivers that clash.
    - `size`: relative size of that disturbance, which counts as one of the inputs.
    - `unsolvable`: no answer exists, so that only a flag is right.
    - `refused`: the documentation says that such an input is refused.
    - `sense`: the mechanism is at rest, and the sense of slip is given.
    - `x0`: start of routes that have one.
    - `path`: what derivatives are taken by.
    - `units`: factors of (length, angle, mass, time) for the routes that change units.
    """

    family: str
    name: str
    build: Builder
    parameters: Parameters
    routes: tuple[str, ...]
    friction: bool = False
    disturb: Callable[[Exact], Exact] | None = None
    size: float = 0.0
    unsolvable: bool = False
    refused: bool = False
    sense: bool = False
    x0: float = 0.0
    path: Any = None
    units: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def exact(self) -> Exact:
        """The exact mechanism."""
        return self.build(self.parameters)

    @cached_property
    def given(self) -> Exact:
        """What the library is given."""
        return self.exact if self.disturb is None else self.disturb(self.exact)

    @cached_property
    def sharpness(self) -> float:
        """sigma_r / sigma_1 of Phi_q with rows of length 1 and angles times a length."""
        jacobian = exact.floats(self.exact.jacobian)
        if isinstance(self.exact, exact.Mechanism):
            angular = 2 * len(self.exact.bodies)
            force = np.array([kind == "force" for kind in self.exact.kinds])
            length = np.max(np.abs(jacobian[force, angular:]))
            jacobian[:, angular:] /= length
        sizes = np.linalg.norm(jacobian, axis=1, keepdims=True)
        sigma = np.linalg.svd(jacobian / np.where(sizes > 0, sizes, 1.0), compute_uv=False)
        return float(sigma[self.exact.rank - 1] / sigma[0])

    @cached_property
    def contraction(self) -> float:
        """Spectral radius of Gamma under minimum norm, 0 without friction."""
        return friction.contraction(self.exact) if self.friction else 0.0

    @property
    def well_posed(self) -> bool:
        """Whether a flag would be a false one."""
        return self.sharpness > 1e-3 and self.contraction < 0.9 and not self.unsolvable and not self.refused

    @cached_property
    def kinds(self) -> dict[str, np.ndarray]:
        """Kinds of the entries of each part of an answer."""
        n = self.exact.n
        linear = n if isinstance(self.exact, Linear) else 2 * n // 3
        return {
            "acceleration": np.array(["linear"] * linear + ["angular"] * (n - linear)),
            "multipliers": np.array(self.exact.kinds),
            "friction": np.array(["friction"] * (len(self.exact.slips) if self.friction else 0)),
        }


@exactly
def perturbed(x, eps: float, rng: np.random.Generator):
    """Every number of a nested tuple or dictionary times 1 + u, eps / 2 <= |u| <= eps.

    Sizes differ, so that changes of equal numbers do not cancel.
    """
    if isinstance(x, Mapping):
        return {name: perturbed(value, eps, rng) for name, value in x.items()}
    if isinstance(x, tuple):
        return tuple(perturbed(item, eps, rng) for item in x)
    return x * (1 + _change(eps, rng))


def _change(eps: float, rng: np.random.Generator):
    return mp.mpf(eps) * mp.mpf(rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 1.0))


@cache
def neighbours(case: Case, eps: float, count: int) -> list[tuple[Parameters, Exact | None]]:
    """Perturbed parameters and their mechanisms, in body frames moved by eps; None for what cannot be assembled."""
    rng = np.random.default_rng(zlib.crc32(f"{case.family} {case.name}".encode()))
    found = []
    for _ in range(count):
        parameters = perturbed(case.parameters, eps, rng)
        mechanism = case.build(parameters)
        found.append(
            (parameters, reframed(mechanism, eps, rng) if isinstance(mechanism, exact.Mechanism) else mechanism)
        )
    return found


@cache
def equations_near(case: Case, eps: float, count: int) -> list[tuple[Parameters, Exact]]:
    """The mechanism with perturbed equations (7): every entry of M, Q and of the independent rows of Phi_q and gamma.

    The other rows stay combinations of these, with perturbed coefficients.
    """
    rng = np.random.default_rng(zlib.crc32(f"{case.name} of {case.family}".encode()))
    return [(case.parameters, _other_equations(case.exact, eps, rng)) for _ in range(count)]


@exactly
def _other_equations(mechanism: Exact, eps: float, rng: np.random.Generator) -> Exact:
    def changed(matrix):
        return mp.matrix(perturbed(tuple(tuple(row) for row in matrix.tolist()), eps, rng))

    jacobian, gamma = mechanism.jacobian, mechanism.gamma
    rows = exact.independent_rows(jacobian, mechanism.rank)
    rest = [row for row in range(mechanism.m) if row not in rows]
    free = mp.matrix([list(jacobian[row, :]) for row in rows])
    new, new_gamma = changed(free), changed(mp.matrix([gamma[row] for row in rows]))
    out, out_gamma = jacobian.copy(), gamma.copy()
    for place, row in enumerate(rows):
        out[row, :], out_gamma[row] = new[place, :], new_gamma[place]
    if rest:
        dependent = mp.matrix([list(jacobian[row, :]) for row in rest])
        combinations = changed(exact.solve_columns(free * free.T, free * dependent.T).T)
        combined, combined_gamma = combinations * new, combinations * new_gamma
        for place, row in enumerate(rest):
            out[row, :], out_gamma[row] = combined[place, :], combined_gamma[place]
    other = dataclasses.replace(mechanism)
    mass = mp.diag(
        [x[0] for x in changed(mp.matrix([mechanism.mass_matrix[i, i] for i in range(mechanism.n)])).tolist()]
    )
    other.__dict__.update(jacobian=out, gamma=out_gamma, mass_matrix=mass, load=changed(mechanism.load))
    return other


@exactly
def reframed(mechanism: exact.Mechanism, eps: float, rng: np.random.Generator) -> exact.Mechanism:
    """The same assembly with the frame, so the centre of mass, of every body moved by eps times the size of all."""
    size = max(abs(x) for x in mechanism.q[: 2 * len(mechanism.bodies)])
    shift = [(mp.mpf(0),) * 2] + [tuple(size * _change(eps, rng) for _ in range(2)) for _ in mechanism.bodies]
    q, qd, b = list(mechanism.q), list(mechanism.qd), len(mechanism.bodies)
    for body in range(b):
        c, s = mp.cos(q[2 * b + body]), mp.sin(q[2 * b + body])
        dx, dy = shift[body + 1]
        x, y = c * dx - s * dy, s * dx + c * dy
        rate = qd[2 * b + body]
        q[2 * body], q[2 * body + 1] = q[2 * body] + x, q[2 * body + 1] + y
        qd[2 * body], qd[2 * body + 1] = qd[2 * body] - rate * y, qd[2 * body + 1] + rate * x

    def moved(joint):
        points = {
            name: tuple(p - d for p, d in zip(getattr(joint, name), shift[body], strict=True))
            for name, body in (("s_i", joint.i), ("s_j", joint.j))
        }
        return dataclasses.replace(joint, **points)

    return dataclasses.replace(
        mechanism,
        revolutes=tuple(moved(joint) for joint in mechanism.revolutes),
        translationals=tuple(moved(joint) for joint in mechanism.translationals),
        q=tuple(q),
        qd=tuple(qd),
    )


def parts_of(solution: exact.Solution) -> dict:
    """The parts of an exact solution as lists of 50-digit numbers."""
    return {part: list(getattr(solution, part)) for part in PARTS}


@exactly
def difference(one: dict, other: dict) -> dict[str, np.ndarray]:
    """|one - other| for each part."""
    return {part: np.array([float(abs(a - b)) for a, b in zip(one[part], other[part], strict=True)]) for part in PARTS}
