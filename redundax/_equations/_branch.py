"""The rows that the constraints lack at a singular position, where branches of motion meet.

With P the self-stress and Z the motions there, the constraints derived once more along the motion (v, 1) and
multiplied by P,

    B a = b,   B = P d(Phi_q)/dt,   b = -P Phi''' / 3                             from  P (3 Phi_qq[v, a] + Phi''') = 0,

say nothing of self-stress that lasts, along which both sides are what (7) says already, and are the missing rows for
self-stress of this position alone: the range of C = B Z. With C^+ and the factor kappa, the multiplier of these rows,

    M a + Phi_q^T lam + B^T kappa = f,   Phi_q a = g,   B a = b,

and all of it is (7) with more rows, whose inverse, self-stress and motions are, since the rows of C are motions,

    [K; B]^- = [K^+ - C^+ B K^+, C^+],   P - C C^+,   Z - C^+ C.

Beside the position, at the time t from it, B t is what its rows have that it lacks, and lam = kappa / t + ... grows
without bound. What is added to that has a part along the local self-stress that only the next order knows. So rows that
it touches have no multipliers, nor have those that lasting self-stress couples with them.

The velocity decides the branch if C has the rank that the rows lack: if the self-stress that is left does not bend
along the motions that are left. It does not at rest, where C is zero, nor where branches touch.
"""

from typing import NamedTuple

from jaxtyping import Array, Bool, Float, Int

from .._system._decision import CLEAR, Decision
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import or_one, xp
from .._tools._value import AbstractModule
from ._evidence import ratio
from ._kinematics import third_order
from ._rank import Split, split
from ._scaling import Scaling


class Branch(AbstractModule):
    """What the velocity decides at a singular position.

    - `beside`: how far off the position is, as the largest relative singular value that is taken for none.
    - `count`: number of self-stress states of this position alone; 0 where the velocity does not decide.
    - `decision`: whether the velocity decides accelerations along as many motions as there are such states seen.
    - `touching`: whether self-stress that the velocity leaves bends along motions that it leaves, as where branches
      touch.
    - `contradiction`: whether no acceleration meets the rows: the velocity is along no branch.
    - `growth`: kappa, without friction: beside the position, at the time t from it, the multipliers are kappa / t and
      what stays finite, up to lasting self-stress; shape (m,), zero for rows that the local self-stress leaves alone.
    - `lost`: rows that the local self-stress touches, or self-stress couples with them, shape (m,): their multipliers
      are unbounded beside the position or not known at it.
    - `alone`: whether the self-stress of the other rows lasts without these.
    """

    beside: Float[Array, ""]
    count: Int[Array, ""]
    decision: Decision
    touching: Decision
    contradiction: Decision
    growth: Float[Array, " m"]
    lost: Bool[Array, " m"]
    alone: Bool[Array, ""]

    @property
    def checks(self) -> tuple[tuple[Bool[Array, ""], RESULTS], ...]:
        """What must hold for the velocity to decide the branch."""
        return (
            (~self.decision.is_no, RESULTS.singular_position),
            (self.decision.is_yes, RESULTS.ambiguous_position),
            (~self.touching.is_yes, RESULTS.singular_position),
            (self.touching.is_no, RESULTS.ambiguous_position),
            (~self.contradiction.is_yes, RESULTS.inadmissible_velocity),
            (self.contradiction.is_no, RESULTS.ambiguous_position),
        )


class Lacking(NamedTuple):
    """The scaled equations with the rows that they lack.

    - `matrix`, `wanted`, `inverse`: [K; B], (2m, n), [g; b], (2m,), and the inverse, (n, 2m); B and b over `size`.
    - `parts`: the first m columns of the inverse, the lasting self-stress and the motions along the branch.
    - `local`: the projector C C^+ onto the local self-stress, and `states` its rank.
    - `decision`: whether C has a rank.
    - `size`: of B and b, which stand over it.
    - `kept`: smallest kept singular value of the whole, relative: by its inverse rounding is magnified.
    - `turn`, `bend`: the rates of the scaled Jacobian, (m, n), and Phi''' / 3, (m,), over `size`: B = P `turn`,
      b = -P `bend`.
    - `blur`: what rounding and violation make of B and b, relative to `turn` a and `bend`.
    """

    matrix: Float[Array, "2m n"]
    wanted: Float[Array, " 2m"]
    inverse: Float[Array, "n 2m"]
    size: Float[Array, ""]
    parts: Split
    local: Float[Array, "m m"]
    states: Int[Array, ""]
    decision: Decision
    kept: Float[Array, ""]
    blur: Float[Array, ""]
    turn: Float[Array, "m n"]
    bend: Float[Array, " m"]

    def contradiction(self, a: Float[Array, " n"]) -> Decision:
        """Whether accelerations contradict the rows along lasting self-stress."""
        left = self.parts.stress @ (self.wanted - self.matrix @ a)[len(self.bend) :]
        return Decision(ratio(left, xp.abs(self.turn) @ xp.abs(a), self.bend) / (10 * self.blur))


def lacking(
    system: AbstractSystem,
    state: State,
    equations: tuple[Float[Array, "m n"], Float[Array, " m"]],
    parts: Split,
    scales: Scaling,
    kept: Float[Array, ""],
    noise: tuple[Float[Array, ""], Float[Array, ""]],
) -> Lacking:
    """K and g with the rows that they lack; `noise` is that of K and that of the velocity."""
    rate, third = third_order(system, state)
    turn = scales.scaled(rate)
    size = or_one(xp.linalg.norm(turn))
    turn, bend = turn / size, third / scales.rows / (3 * size)
    rows, wanted = parts.stress @ turn, -parts.stress @ bend
    seen = rows @ parts.motion
    largest = or_one(xp.linalg.norm(seen))
    blur = noise[0] / kept + noise[1] / (scales.size * size)
    found, spectrum = split(seen / largest, blur / largest, None)
    inverse, local = found.inverse / largest, parts.stress - parts.stress @ found.stress
    clear = xp.where(spectrum.decision.is_yes, 0.0, 0.5 * CLEAR).astype(kept.dtype)
    own = parts.inverse - inverse @ (rows @ parts.inverse)
    return Lacking(
        matrix=xp.concatenate([equations[0], rows]),
        wanted=xp.concatenate([equations[1], wanted]),
        inverse=xp.concatenate([own, inverse], axis=1),
        size=size,
        parts=Split(own, parts.stress - local, parts.motion @ found.motion),
        local=local,
        states=spectrum.rank,
        decision=Decision(xp.where(spectrum.rank > 0, spectrum.decision.margin, clear)),
        kept=kept * xp.where(spectrum.rank > 0, xp.minimum(largest * spectrum.kept, 1.0), 1.0),
        blur=blur,
        turn=turn,
        bend=bend,
    )


def lost_rows(more: Lacking, stress: Float[Array, "m m"], noise: Float[Array, ""]) -> Bool[Array, " m"]:
    """Rows of the local self-stress, and those that any self-stress, of the projector `stress`, couples with them."""
    linked = xp.abs(stress) > noise
    for _ in range(len(stress).bit_length()):
        linked = linked.astype(stress.dtype) @ linked.astype(stress.dtype) > 0
    touched = (xp.linalg.norm(more.local, axis=1) > xp.minimum(100 * more.blur, 1e-3)) & (more.states > 0)
    return xp.any(linked & touched, axis=1) | touched
