"""Large scenes: time against the number of loops, of one solve and of a motion of 1 s, beside other programs.

    python benchmarks/large_scenes.py [--loops N ...] [--repeats N] [--limit SECONDS]

N-four-bar: N loops of cranks and couplers, n + m = 12 N + 5; its cranks turn as one pendulum, which is the truth of
accelerations and motions. With every third pin twice over the minimum norm halves what these carry.

Motions are run to an error of 1e-6 in the crank angle: redundax with the largest tolerance that reaches it, peers with
as many steps as they need, doubled each time, or ">" where a run takes longer than the limit before. Times of
redundax are medians of calls after the first; compilation stands by itself.
"""

import argparse
import pathlib
import resource
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from benchmarks._devices import prepare

prepare()

import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import numpy as np  # noqa: E402

import redundax as rx  # noqa: E402
from benchmarks.motions import _exudyn, _mujoco  # noqa: E402
from benchmarks.motions._problems import GRAVITY, crank, crank_angle, stiffness  # noqa: E402

PHI, T1, ERROR = 0.8, 1.0, 1e-6


def rack(loops: int) -> tuple[rx.Mechanism, list[str]]:
    """N-four-bar with every third pin twice over, and these."""
    rod = {"mass": 1.0, "inertia": 1 / 12}
    bodies = [rx.Body(f"{kind}{k}", **rod) for kind, count in (("c", loops + 1), ("b", loops)) for k in range(count)]
    pins = [(f"A{k}", f"c{k}", "ground", (-0.5, 0.0), (float(k), 0.0)) for k in range(loops + 1)]
    for k in range(loops):
        pins.append((f"B{k}", f"b{k}", f"c{k}", (-0.5, 0.0), (0.5, 0.0)))
        pins.append((f"C{k}", f"b{k}", f"c{k + 1}", (0.5, 0.0), (0.5, 0.0)))
    joints = [rx.Revolute(*pin) for pin in pins] + [rx.Revolute(f"{pin[0]}'", *pin[1:]) for pin in pins[::3]]
    pose = rx.mechanisms.n_four_bar(loops).pose
    return rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY), pose=pose), [pin[0] for pin in pins[::3]]


def timed(run: Callable, repeats: int) -> tuple[float, float, object]:
    """Seconds of the first call, median of the others, and the value."""
    seconds = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        value = jax.block_until_ready(run())
        seconds.append(time.perf_counter() - start)
    return seconds[0], float(np.median(seconds[1:])), value


def solve(mechanism: rx.Mechanism, state: rx.State, repeats: int) -> tuple[float, float, tuple]:
    """As `timed`, of one solve without friction."""

    @eqx.filter_jit
    def found(mechanism: rx.Mechanism, state: rx.State) -> tuple:
        solution = rx.solve(mechanism, state)
        return solution.acceleration, solution.multipliers, solution.stats.redundancy

    return timed(lambda: found(mechanism, state), repeats)


def solves(loops: int, repeats: int) -> str:
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
    figures = f"{first:10.1f} {1e3 * seconds:9.3f} {error:8.0e} {1e3 * more:13.3f} {off:8.0e} {right:>10}"
    return f"{loops:6} {12 * loops + 5:7} {figures} {_memory():8.2f}"


def motions(loops: int, repeats: int, limit: float) -> Iterator[str]:
    """Lines of the second table."""
    mechanism = rx.mechanisms.n_four_bar(loops).sparse(loops >= 10)  # where that is faster in motions
    state = mechanism.state(np.pi / 2, rate=-1.0)
    truth = crank_angle(stiffness(loops), np.pi / 2, -1.0, T1)
    for rtol in 10.0 ** -np.arange(4, 10):
        first, seconds, motion = timed(partial(rx.simulate, mechanism, state, T1, ts=[T1], rtol=rtol), repeats)
        error = abs(float(motion.q[0, crank(loops)]) - truth)
        if error <= ERROR:
            steps = int(motion.stats.steps + motion.stats.rejected)
            yield _motion(loops, "redundax", first, seconds, steps, error)
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
        yield _motion(loops, name, 0.0, seconds, steps, error)


def _motion(loops: int, program: str, first: float, seconds: float, steps: int, error: float) -> str:
    more = " " if error <= ERROR else ">"
    return (
        f"{loops:6} {program:14} {first:8.1f} {more}{seconds:9.4f} {steps:8} {1e3 * seconds / steps:9.4f} {error:8.0e}"
    )


def _memory() -> float:
    """GB that this process has had at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--loops", type=int, nargs="+", default=[1, 10, 40, 100, 1000], help="numbers of loops")
    parser.add_argument("--repeats", type=int, default=5, help="timed calls")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds of a peer's run, at most about")
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"{'loops':>6} {'n + m':>7} {'first s':>10} {'ms':>9} {'error':>8} {'doubled ms':>13} {'error':>8} "
          f"{'redundancy':>10} {'GB':>8}")  # fmt: skip
    for loops in given.loops:
        print(solves(loops, given.repeats), flush=True)
    print(f"\n{'loops':>6} {'motion of 1 s':14} {'first s':>8} {'s':>10} {'steps':>8} {'ms/step':>9} {'error':>8}")
    for loops in given.loops:
        for line in motions(loops, given.repeats, given.limit):
            print(line, flush=True)


if __name__ == "__main__":
    main()
