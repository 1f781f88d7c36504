"""Whether joints that are stiff but elastic settle at a frictional solution.

Beside a solution of (25) let the constraints give way by e = Phi_q dq, and the multipliers by dlam with e = W dlam. On
the time scale of stiff joints, where all else stands still,

    M dq'' = -(Phi_q^T - F_lam) dlam,   F_lam = E J R,   J = d law / d rho,   R the rows that friction reads,

so that e'' = -s e with the eigenvalues s of Phi_q M^-1 (Phi_q^T - F_lam) W^-1, taken over what the constraints can do:
its k zeros along the self-stress are no motion. Solved for dlam with the closure's pick (I - G W) and the responses of
`_reduced`, Lam and K = R Lam to unit friction, and with the apparent mass M_c,

    1/s = eigenvalues of W_e X,   W_e = W - W G W,   X = M_c + Lam (I - J K)^-1 J R (I - G W) M_c,

which holds for rigid joints too (W singular) and for M that is singular but (14). With W_e = L L^T they are those of
L^T X L. Positive s: vibration with the angular frequency sqrt(s); negative: the load runs away from the solution as
exp(sqrt(-s) t); complex: flutter, a vibration that grows unless damping removes more. All s grow alike as joints get
stiffer, so the verdict is one on the ratios of compliances.
"""

import dataclasses
import enum
import itertools

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Complex, Float

from .._closures._closure import AbstractClosure, Elasticity, check_closure, elasticity, without_rows
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solve._contacts import as_held
from .._solve._reduced import reduce
from .._solve._solution import Solution
from .._system._contact import Contact, code_of, refuse_declared, rows_that_hold
from .._system._names import ByName, senses
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._json import JSON
from .._tools._module import check_kind
from .._tools._numbers import xp
from .._tools._questions import question

_RIGID = 1e-13  # 1/s and compliance, relative to the largest, that are rounding
_COMPLEX = 1e-7  # relative imaginary part of s that rounding at a double eigenvalue does not reach


class Settling(enum.Enum):
    """What stiff elastic joints do beside a solution; nothing where none carries, as of a body that falls.

    ??? example

        ```python
        joints = rx.Compliance(W=jnp.full(12, 1e-8))
        solution = rx.solve(mechanism, state, closure=joints)
        rx.stability(mechanism, state, solution, joints).verdict is rx.Settling.STABLE
        ```
    """

    STABLE = "stable: the joints vibrate about it"
    FLUTTER = "flutter: a vibration of the joints grows unless damped"
    DIVERGENCE = "divergence: the joints' loads run away from it"
    NOTHING = "nothing to judge: no joint that carries gives way"


@dataclasses.dataclass(frozen=True)
class Stability:
    """Stability of a solution under the compliance of its joints; `str()` gives a sentence.

    - `eigenvalues`: s, squares of angular frequencies of the joints' vibrations, rad^2/s^2, by increasing real part;
      one for each direction in which joints give way against a mass, at most r; none where nothing that carries does.
    - `growth`: the fastest growth among them, Im sqrt(s), 1/s; 0 where all vibrate. Damping adds to that.
    - `verdict`: what follows.
    - `touching`: one-sided contacts that touch without load. They are stiff to one side alone, which no linear figure
      tells, and are left out here.

    ??? example

        ```python
        joints = rx.Compliance(W=jnp.full(12, 1e-8))
        solution = rx.solve(mechanism, state, closure=joints)
        found = rx.stability(mechanism, state, solution, joints)
        found.eigenvalues, found.growth
        ```
    """

    eigenvalues: Complex[np.ndarray, " modes"]
    growth: float
    verdict: Settling
    touching: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; an eigenvalue is a pair (real, imaginary)."""
        pairs = [[float(np.real(s)), float(np.imag(s))] for s in self.eigenvalues]
        said = {"eigenvalues": pairs, "growth": self.growth, "verdict": self.verdict.value}
        return {**said, "touching": list(self.touching)}

    def __str__(self) -> str:
        growth = f", growth {self.growth:.3g} 1/s" if self.growth else ""
        left_out = f", without {', '.join(self.touching)}, which touch without load" if self.touching else ""
        return f"{self.verdict.value}{growth}{left_out}"


@question
def stability(
    system: AbstractSystem,
    state: State,
    solution: Solution,
    closure: AbstractClosure,
    *,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
) -> Stability:
    """Stability of a frictional solution under the compliance of its joints.

    ??? example

        ```python
        joints = rx.Compliance(W=jnp.full(12, 1e-8))
        solution = rx.solve(mechanism, state, closure=joints)
        print(rx.stability(mechanism, state, solution, joints))
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `solution`: a successful solution under the closure.
    - `closure`: the compliance of the joints.
    - `sense`, `rank`, `factor`: as in `solve`.

    Of one-sided contacts those vibrate that carry in the solution: small vibrations do not open them.

    **Raises:** `ValueError` where the solution has no numbers; `RuntimeError` at a singular position.
    """
    check_system_at(system, state)
    check_closure(closure)
    check_kind("solution", solution, Solution, "a solution", "Give what `rx.solve` gives.")
    if not is_one_of(solution.result, RESULTS.successful):
        raise RedundaxError(
            "Argument `solution` must be successful, but ended with another result. Solve with `throw=True` to see why."
        )
    kept, touching = None, ()
    if system.names.one_sided:
        kept, touching = _carried(system, solution, rank, factor)
        system = as_held(system, kept)
    system, factor = dense_at(system, state, rank, factor)
    slips = senses(system.slips, sense)
    if factor.branch is not None:  # what is stiff here is soft beside it
        raise NoSolutionError(RESULTS[RESULTS.singular_position])
    given = elasticity(closure, system, state)
    given = given if kept is None else without_rows(given, kept)
    compliance, response = _figures(system.anonymous, state, factor, solution.multipliers, given, slips)
    size, axes = np.linalg.eigh(compliance)
    soft = size > _RIGID * size[-1]
    root = axes[:, soft] * np.sqrt(size[soft])
    inverse = np.linalg.eigvals(root.T @ response @ root).astype(complex)
    inverse = inverse[np.abs(inverse) > _RIGID * np.abs(inverse).max(initial=0.0)]
    eigenvalues = 1 / inverse
    complex_ = np.abs(np.imag(eigenvalues)) > _COMPLEX * np.abs(eigenvalues)
    eigenvalues = np.sort_complex(np.where(complex_, eigenvalues, np.real(eigenvalues)))
    growth = float(np.abs(np.imag(np.sqrt(eigenvalues))).max(initial=0.0))
    return Stability(eigenvalues, growth, _verdict(eigenvalues), touching)


def _carried(
    system: AbstractSystem, solution: Solution, rank: ArrayLike | None, factor: Factorisation | None
) -> tuple[Bool[Array, " m"], tuple[str, ...]]:
    """The rows that hold in a solution, without contacts that carry nothing; and names of those of them that touch."""
    names, codes = system.names, np.asarray(solution.contact)
    refuse_declared(names, rank=rank, factor=factor)
    if solution.contact is None or codes.shape != (len(names.one_sided),):
        raise RedundaxError(
            f"Argument `solution` must be one of `solve` for this system, which has one-sided contacts, "
            f"{', '.join(names.contacts)}, but does not tell what they do. Solve the same system."
        )
    carries, touches = (codes == code_of(word) for word in (Contact.carries, Contact.touches))
    return rows_that_hold(names, carries, carries | touches), tuple(itertools.compress(names.contacts, touches))


def _verdict(eigenvalues: np.ndarray) -> Settling:
    if not eigenvalues.size:
        return Settling.NOTHING
    turning = np.imag(eigenvalues) != 0
    if np.any(~turning & (np.real(eigenvalues) < 0)):
        return Settling.DIVERGENCE
    return Settling.FLUTTER if np.any(turning) else Settling.STABLE


def _figures(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    multipliers: Array,
    chosen: Elasticity,
    sense: Array | None,
) -> tuple[Float[Array, "m m"], Float[Array, "m m"]]:
    """W_e and X in multipliers free of units."""
    reduced = reduce(system, state, factor, chosen, sense=sense)
    given = chosen.compliance @ reduced.pick(xp.eye(multipliers.size, dtype=multipliers.dtype))
    mass = response = factor.apparent_mass()
    if reduced.problem is not None:
        slope = reduced.problem.law.slope(multipliers[reduced.rows])
        loop = xp.eye(slope.shape[0], dtype=slope.dtype) - slope @ reduced.problem.gain
        friction = xp.linalg.solve(loop, slope @ reduced.pick(mass)[reduced.rows])
        response = mass + reduced.response.unit.multipliers @ friction
    scale = factor.row_scale
    return (given + given.T) / (2 * scale[:, None] * scale), scale[:, None] * response * scale
