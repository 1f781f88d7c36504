"""Large scenes: time against the number of loops, of one solve and of a motion of 1 s, beside other programs.

    python benchmarks/large_scenes.py [--only TABLE ...] [--loops N ...] [--repeats N] [--limit SECONDS]
                                      [--smallest]

N-four-bar: N loops of cranks and couplers, n + m = 12 N + 5; its cranks turn as one pendulum, which is the truth of
accelerations and motions. With every third pin twice over the minimum norm halves what these carry.

`friction` has pins that rub, a third of them twice over, and 100 values of h; its error is that against dense
matrices. `ladder` is the same row of parallelograms in space, with 3 redundant constraints a loop. `gradients` are
those of the crank angle after 1 s of 100 loops, by the length of the cranks in forward mode and by the masses of all
cranks in reverse mode, against those of the pendulum; and with friction after 0.1 s by the friction of all 402 pins in
reverse mode, against differences of values. `sticking` has a pendulum on each coupler of cranks that friction holds;
all stop within moments, one after the other, where each would alone.

`assembly` starts 10 mm and 10 mrad off, with the angle and the rate of one crank given; a picture, and how many lines
a print of the mechanism has, stand beside it.

Motions are run to an error of 1e-6 in the crank angle: redundax with the largest tolerance that reaches it, peers with
as many steps as they need, doubled each time, or ">" where a run takes longer than the limit before. Times of
redundax are medians of calls after the first; compilation stands by itself.
"""

import argparse
import itertools
import pathlib
import resource
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
sys.path.insert(1, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "support"))

from benchmarks._devices import prepare

prepare()

import diffrax  # noqa: E402
import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import numpy as np  # noqa: E402
import racks  # noqa: E402
from jax.typing import ArrayLike  # noqa: E402
from truth import swings  # noqa: E402

import redundax as rx  # noqa: E402
from benchmarks.motions import _exudyn, _mujoco  # noqa: E402
from benchmarks.motions._figure import STYLES  # noqa: E402
from benchmarks.motions._problems import GRAVITY, crank, crank_angle, stiffness  # noqa: E402

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PHI, T1, ERROR = 0.8, 1.0, 1e-6
RUBS = 0.1  # end of the motion with friction


def rack(loops: int, mu: ArrayLike | None = None) -> tuple[rx.Mechanism, list[str]]:
    """N-four-bar with every third pin twice over, and these; with friction of its pins, one or each, where given."""
    bodies, pins = racks.parts(loops)
    doubled = [pin[0].removesuffix("'") for pin in pins if pin[0].endswith("'")]
    if mu is None:
        joints = [rx.Revolute(*pin) for pin in pins]
    else:
        rubs = map(rx.Coulomb, jax.numpy.broadcast_to(mu, len(pins)))
        joints = [rx.Revolute(*pin, friction=rub, pin_radius=0.1) for pin, rub in zip(pins, rubs, strict=True)]
    pose = rx.mechanisms.n_four_bar(loops).pose
    return rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY), pose=pose), doubled


def ladder(loops: int) -> tuple[rx.Mechanism, rx.State]:
    """N-four-bar in space, cranks at PHI that turn at 1 rad/s."""
    inertia, tip = (1e-3, 1 / 12, 1 / 12), np.array([np.cos(PHI), np.sin(PHI), 0.0])
    turned = (np.cos(PHI / 2), 0.0, 0.0, np.sin(PHI / 2))
    bodies, joints = [], []
    for k in range(loops + 1):
        foot = np.array([float(k), 0.0, 0.0])
        bodies.append(rx.spatial.Body(f"c{k}", 1.0, inertia, position=foot + tip / 2, orientation=turned))
        joints.append(rx.spatial.Revolute(f"A{k}", bodies[-1], "ground", point=foot, axis=(0.0, 0.0, 1.0)))
    for k in range(loops):
        foot = np.array([float(k), 0.0, 0.0])
        bar = rx.spatial.Body(f"b{k}", 1.0, inertia, position=foot + tip + (0.5, 0.0, 0.0))
        for name, at in (("B", k), ("C", k + 1)):
            end = np.array([float(at), 0.0, 0.0]) + tip
            joints.append(rx.spatial.Revolute(f"{name}{k}", bar, bodies[at], point=end, axis=(0.0, 0.0, 1.0)))
        bodies.append(bar)
    mechanism = rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY, 0.0)).sparse()
    still = mechanism.reference
    rates = np.zeros((2, len(bodies), 3))
    for k, body in enumerate(bodies):
        is_crank = body.name.startswith("c")
        rates[0, k] = np.array([-tip[1], tip[0], 0.0]) / (2 if is_crank else 1)
        rates[1, k, 2] = is_crank
    return mechanism, rx.State(still, rates.ravel(), 0.0)


WARM = 10.0  # seconds in which programs of motions take over


def timed(run: Callable, repeats: int, warm: float = 0.0) -> tuple[float, float, object]:
    """Seconds of the first call, median of the last ones, and the value; after so many seconds at least."""
    seconds, value = [], None
    while len(seconds) <= repeats or sum(seconds) < warm:
        start = time.perf_counter()
        value = jax.block_until_ready(run())
        seconds.append(time.perf_counter() - start)
    return seconds[0], float(np.median(seconds[-repeats:])), value


def solve(mechanism: rx.Mechanism, state: rx.State, repeats: int) -> tuple[float, float, tuple]:
    """As `timed`, of one solve without friction."""

    @eqx.filter_jit
    def found(mechanism: rx.Mechanism, state: rx.State) -> tuple:
        solution = rx.solve(mechanism, state)
        return solution.acceleration, solution.multipliers, solution.stats.redundancy

    return timed(lambda: found(mechanism, state), repeats)


class Solve(NamedTuple):
    """A line of the first table."""

    loops: int
    first: float
    seconds: float
    error: float
    doubled: float
    off: float
    redundancy: str
    memory: float

    def __str__(self) -> str:
        figures = f"{self.first:10.1f} {1e3 * self.seconds:9.3f} {self.error:8.0e} {1e3 * self.doubled:13.3f}"
        figures += f" {self.off:8.0e} {self.redundancy:>10}"
        return f"{self.loops:6} {12 * self.loops + 5:7} {figures} {self.memory:8.2f}"


class Motion(NamedTuple):
    """A line of the last table; peers compile nothing."""

    loops: int
    program: str
    first: float
    seconds: float
    steps: int
    error: float

    def __str__(self) -> str:
        more = " " if self.error <= ERROR else ">"
        figures = f"{self.seconds:9.4f} {self.steps:8} {1e3 * self.seconds / self.steps:9.4f} {self.error:8.0e}"
        return f"{self.loops:6} {self.program:14} {self.first:8.1f} {more}{figures}"


def solves(loops: int, repeats: int) -> Solve:
    """A line of the first table."""
    mechanism, (double, twice) = rx.mechanisms.n_four_bar(loops).sparse(), rack(loops)
    state = mechanism.state(PHI, rate=1.0)
    first, seconds, (a, single, _) = solve(mechanism, state, repeats)
    _, more, (_, lam, redundancy) = solve(double.sparse(), state, repeats)
    cranks = np.asarray(a)[crank(loops) : crank(loops) + loops + 1]
    error = np.max(np.abs(cranks / (-stiffness(loops) * np.cos(PHI)) - 1))
    single, lam, halved = np.asarray(single), np.asarray(lam), set(twice)
    share = np.array([0.5 if label.split(".")[0] in halved else 1.0 for label in double.rows.labels[: single.size]])
    off = np.max(np.abs(lam[: single.size] - share * single)) / np.max(np.abs(single))
    right = "exact" if int(redundancy) == 2 * len(twice) else "WRONG"
    return Solve(loops, first, seconds, error, more, off, right, _memory())


def frictions(loops: int, repeats: int) -> str:
    """A line of the table on friction."""
    mechanism, _ = rack(loops, 0.1)
    state, hs = mechanism.state(PHI, rate=1.0), np.linspace(-20.0, 20.0, 100)

    @eqx.filter_jit
    def found(mechanism: rx.Mechanism, hs: jax.Array) -> tuple:
        def one(h: jax.Array) -> tuple:
            solution = rx.solve(mechanism, state, closure=rx.MinimumNorm(h))
            return solution.acceleration, solution.friction, solution.stats.steps

        return jax.vmap(one)(hs)

    sparse, error = mechanism.sparse(), np.nan
    first, single, _ = timed(lambda: found(sparse, hs[:1]), repeats)
    _, seconds, many = timed(lambda: found(sparse, hs), repeats)
    if loops <= 40:
        true = found(mechanism.sparse(False), hs)
        error = max(float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in zip(many[:2], true[:2], strict=True))
    joints = len(mechanism.slips)
    each = 1e6 * seconds / joints / hs.size
    figures = f"{first:8.1f} {1e3 * single:9.2f} {1e3 * seconds:10.1f} {each:9.2f}"
    return f"{joints:7} {figures} {int(many[2][0]):6} {error:8.0e}"


def ladders(loops: int, repeats: int) -> str:
    """A line of the table on ladders in space."""
    mechanism, state = ladder(loops)
    first, seconds, (a, _, redundancy) = solve(mechanism, state, repeats)
    turns = np.asarray(a).reshape(2, -1, 3)[1, : loops + 1, 2]
    error = np.max(np.abs(turns / (-stiffness(loops) * np.cos(PHI)) - 1))
    right = "exact" if int(redundancy) == 3 * loops else f"WRONG {int(redundancy)}"
    return f"{2 * loops + 1:7} {3 * loops:11} {right:>8} {first:8.1f} {1e3 * seconds:9.2f} {error:8.0e}"


def gradients(loops: int, repeats: int) -> Iterator[str]:
    """Lines of the table on gradients."""

    def angle(length: jax.Array, masses: jax.Array, adjoint: diffrax.AbstractAdjoint | None) -> jax.Array:
        mechanism = rx.mechanisms.n_four_bar(loops, crank=length, crank_mass=masses, gravity=GRAVITY).sparse()
        state = mechanism.state(np.pi / 2, rate=-1.0)
        return rx.simulate(mechanism, state, T1, ts=[T1], adjoint=adjoint).q[0, crank(loops)]

    def truth(length: float, mass: float) -> float:
        weight = (loops + 1) * mass
        slope = GRAVITY * (weight / 2 + loops) / (weight / 3 + loops) / length
        return crank_angle(slope, np.pi / 2, -1.0, T1)

    ones, one = jax.numpy.ones(loops + 1), jax.numpy.ones(())
    step = 1e-4
    by_length = (truth(1 + step, 1.0) - truth(1 - step, 1.0)) / (2 * step)
    by_mass = (truth(1.0, 1 + step) - truth(1.0, 1 - step)) / (2 * step) / (loops + 1)
    value = jax.jit(lambda x, m: angle(x, m, None))
    forward = jax.jit(lambda x, m: jax.jvp(lambda x: angle(x, m, diffrax.ForwardMode()), (x,), (one,)))
    backward = jax.jit(lambda x, m: jax.value_and_grad(lambda m: angle(x, m, None))(m))
    first, seconds, found = timed(lambda: value(one, ones), repeats)
    yield f"value          {first:8.1f} {seconds:8.3f} {1.0:7.2f} {abs(float(found) - truth(1.0, 1.0)):8.0e}"
    for name, run, true in (("by a length", forward, by_length), ("by all masses", backward, by_mass)):
        first, more, (_, found) = timed(partial(run, one, ones), repeats)
        error = float(np.max(np.abs(np.asarray(found) / true - 1)))
        yield f"{name:14} {first:8.1f} {more:8.3f} {more / seconds:7.2f} {error:8.0e}"


def gradients_by_friction(loops: int, repeats: int) -> Iterator[str]:
    """Lines of the table on gradients of a motion with friction."""

    def angle(mu: jax.Array, rtol: float) -> jax.Array:
        mechanism = rack(loops, mu)[0].sparse()
        return rx.simulate(mechanism, mechanism.state(PHI, rate=1.0), RUBS, ts=[RUBS], rtol=rtol).q[0, crank(loops)]

    mu = np.full(len(rack(loops, 0.1)[0].slips.labels), 0.1)
    along, step = 0.1 * np.cos(np.arange(mu.size)), 1e-2
    value, backward = jax.jit(angle), jax.jit(jax.value_and_grad(angle))
    first, seconds, _ = timed(lambda: value(mu, 1e-8), repeats)
    yield f"with friction  {first:8.1f} {seconds:8.3f} {1.0:7.2f}"
    ends = [float(value(mu + k * step * along, 1e-12)) for k in (-2, -1, 1, 2)]
    true = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
    first, more, (_, found) = timed(lambda: backward(mu, 1e-8), repeats)
    error = abs(float(found @ along) / true - 1)
    yield f"by all friction {first:7.1f} {more:8.3f} {more / seconds:7.2f} {error:8.0e}"


def stickings(loops: int) -> str:
    """A line of the table on stick and slip."""
    mechanism, state = swings.swings(loops)
    run = partial(rx.simulate, mechanism.sparse(), state, T1, ts=[T1], max_phases=loops + 5, rtol=1e-9, throw=False)
    first, seconds, motion = timed(run, 1, warm=WARM)
    angles = [swings.stop(mu)[1] for mu in swings.frictions(loops)]
    error = np.max(np.abs(np.asarray(motion.q)[0, -loops:] - angles))
    stops = int(motion.stats.phases)
    return (
        f"{loops:7} {len(mechanism.slips):6} {stops:6} {first:8.1f} {seconds:8.2f} {seconds / stops:8.3f} {error:8.0e}"
    )


def motions(loops: int, repeats: int, limit: float) -> Iterator[Motion]:
    """Lines of the last table."""
    mechanism = rx.mechanisms.n_four_bar(loops).sparse(loops >= 10)  # where that is faster in motions
    state = mechanism.state(np.pi / 2, rate=-1.0)
    truth = crank_angle(stiffness(loops), np.pi / 2, -1.0, T1)
    for rtol in 10.0 ** -np.arange(4, 10):
        run = partial(rx.simulate, mechanism, state, T1, ts=[T1], rtol=rtol)
        first, seconds, motion = timed(run, repeats, warm=WARM if rtol == 1e-4 else 0.0)
        error = abs(float(motion.q[0, crank(loops)]) - truth)
        if error <= ERROR:
            steps = int(motion.stats.steps + motion.stats.rejected)
            yield Motion(loops, "redundax", first, seconds, steps, error)
            break
    peers: dict[str, Callable] = {} if _exudyn.missing() else {"Exudyn": _exudyn.run}
    if not _mujoco.missing():
        peers["MuJoCo, RK4"] = lambda loops, steps, rate, t1: _mujoco.run(loops, steps, "RK4", rate, t1)
    for name, run in peers.items():
        steps, seconds, error = 250, 0.0, np.inf
        while error > ERROR and 2 * seconds < limit:
            steps *= 2
            seconds, angle = run(loops, steps, -1.0, T1)
            error = abs(angle - truth)
        yield Motion(loops, name, 0.0, seconds, steps, error)


def assemblies(loops: int, repeats: int) -> str:
    """A line of the table on assemblies and pictures."""
    from matplotlib.figure import Figure

    mechanism = rx.mechanisms.n_four_bar(loops).sparse()
    true = mechanism.state(PHI, rate=1.0)
    guess = np.asarray(true.q) + 0.01 * np.random.default_rng(0).normal(size=true.q.size)
    given = {"positions": {"crank 1.phi": PHI}, "rates": {"crank 1.phi": 1.0}}
    first, seconds, found = timed(lambda: rx.assemble(mechanism, guess, **given), repeats)
    error = max(float(np.max(np.abs(found.q - true.q))), float(np.max(np.abs(found.qd - true.qd))))
    drawn, *_ = timed(lambda: rx.plot.draw(mechanism, true, axes=Figure(figsize=(12, 4)).add_subplot()), 1)
    return f"{loops:6} {first:8.1f} {1e3 * seconds:9.1f} {error:8.0e} {drawn:9.1f} {len(str(mechanism).splitlines()):6}"


def show(row: object) -> None:
    """Print a line, and forget its programs: a process may hold so many memory maps."""
    print(row, flush=True)
    jax.clear_caches()


def _memory() -> float:
    """GB that this process has had at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def figure(solves: list[tuple[int, float]], motions: list[tuple[int, str, float, bool]]) -> "Figure":
    """Time against loops of a solve, and of a motion by each program; hollow where the error is not reached."""
    from matplotlib.figure import Figure

    out = Figure(figsize=(8.0, 3.8), layout="constrained", dpi=150)
    left, right = out.subplots(1, 2)
    left.plot(*zip(*solves, strict=True), label="redundax", **STYLES["redundax"])
    left.set(ylabel="time of one solve, s", title="N-four-bar, one solve")
    for program, style in STYLES.items():
        points = [(loops, seconds, reached) for loops, own, seconds, reached in motions if own == program]
        if points:
            loops, seconds, reached = zip(*points, strict=True)
            style = {**style, "markerfacecolor": "none"}
            right.plot(loops, seconds, linewidth=1.2, **style)
            right.plot(
                [n for n, good in zip(loops, reached, strict=True) if good],
                [s for s, good in zip(seconds, reached, strict=True) if good],
                linestyle="none", label=program, **{**style, "markerfacecolor": style["color"]},
            )  # fmt: skip
    right.set(ylabel="time of the run, s", title="motion of 1 s to 1e-6 rad")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlabel="loops N")
        axes.grid(alpha=0.3, linewidth=0.5)
    right.legend(frameon=False, fontsize=9)
    return out


LOOPS = {"friction": (10, 40, 100, 250), "sticking": (10, 20, 40), "ladder": (5, 25, 100, 250), "gradients": (100,)}
TABLES = ("solves", "assembly", "friction", "sticking", "ladder", "gradients", "motions")


def main() -> None:
    """Print the tables; draw the figure where solves and motions are among them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", nargs="+", choices=TABLES, default=TABLES, help="tables")
    parser.add_argument("--loops", type=int, nargs="+", default=[1, 10, 40, 100, 1000], help="numbers of loops")
    parser.add_argument("--repeats", type=int, default=5, help="timed calls")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds of a peer's run, at most about")
    parser.add_argument("--smallest", action="store_true", help="the fewest loops; no figure, no gradients by friction")
    given = parser.parse_args()
    loops_of = LOOPS
    if given.smallest:
        given.loops, given.repeats, given.limit, loops_of = [1], 1, 0.1, dict.fromkeys(LOOPS, (2,))
    jax.config.update("jax_enable_x64", True)
    rows: dict[str, list] = {name: [] for name in TABLES}
    if "solves" in given.only:
        print(f"{'loops':>6} {'n + m':>7} {'first s':>10} {'ms':>9} {'error':>8} {'doubled ms':>13} {'error':>8} "
              f"{'redundancy':>10} {'GB':>8}")  # fmt: skip
        for loops in given.loops:
            rows["solves"].append(solves(loops, given.repeats))
            show(rows["solves"][-1])
    if "assembly" in given.only:
        print(f"\n{'loops':>6} {'first s':>8} {'ms':>9} {'error':>8} {'drawn s':>9} {'lines':>6}")
        for loops in given.loops:
            show(assemblies(loops, given.repeats))
    if "friction" in given.only:
        print(f"\n{'joints':>7} {'first s':>8} {'ms':>9} {'100 h, ms':>10} {'us/joint':>9} {'passes':>6} {'error':>8}")
        for loops in loops_of["friction"]:
            show(frictions(loops, given.repeats))
    if "sticking" in given.only:
        print(f"\n{'loops':>7} {'joints':>6} {'stops':>6} {'first s':>8} {'s':>8} {'s/stop':>8} {'error':>8}")
        for loops in loops_of["sticking"]:
            show(stickings(loops))
    if "ladder" in given.only:
        print(f"\n{'bodies':>7} {'redundancy':>11} {'':>8} {'first s':>8} {'ms':>9} {'error':>8}")
        for loops in loops_of["ladder"]:
            show(ladders(loops, given.repeats))
    if "gradients" in given.only:
        (loops,) = loops_of["gradients"]
        print(f"\n{f'{loops} loops':14} {'first s':>8} {'s':>8} {'ratio':>7} {'error':>8}")
        rubbing = () if given.smallest else gradients_by_friction(loops, given.repeats)  # compiles for minutes
        for line in itertools.chain(gradients(loops, given.repeats), rubbing):
            print(line, flush=True)
    if "motions" in given.only:
        print(f"\n{'loops':>6} {'motion of 1 s':14} {'first s':>8} {'s':>10} {'steps':>8} {'ms/step':>9} {'error':>8}")
        for loops in given.loops:
            for row in motions(loops, given.repeats, given.limit):
                rows["motions"].append(row)
                show(row)
    if rows["solves"] and rows["motions"]:
        points = (
            [(row.loops, row.seconds) for row in rows["solves"]],
            [(row.loops, row.program, row.seconds, row.error <= ERROR) for row in rows["motions"]],
        )
        picture = figure(*points)
        if not given.smallest:
            picture.savefig(pathlib.Path(__file__).with_suffix(".png"))


if __name__ == "__main__":
    main()
