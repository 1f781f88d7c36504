"""What many bodies ask of an analysis: memory of a few matrices, counts known by hand, releases, or a plain refusal."""

import itertools
import os
import subprocess
import sys
import textwrap

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._analysis._release import releases
from redundax._bodies import _pattern

# Parallel spatial four-bars, each on the ground: 18 coordinates, 20 rows of rank 17, so 3 redundant ones and a freedom.
LEGS = """
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (12 * 2**30, 12 * 2**30))
    import jax
    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    import redundax as rx

    legs, bodies, joints = 12, [], []
    for k in range(legs):
        a, b, c, d = (jnp.array([x, 0.2 * k, z]) for x, z in ((0.0, 0.0), (0.03, 0.1), (0.45, 0.25), (0.5, 0.0)))
        crank, rod, rocker = (
            rx.spatial.Body(f"{name}{k}", 1.0, inertia=(0.01, 0.01, 0.01), position=middle)
            for name, middle in (("crank", (a + b) / 2), ("rod", (b + c) / 2), ("rocker", (c + d) / 2))
        )
        bodies += [crank, rod, rocker]
        pairs = (a, crank, "ground"), (b, rod, crank), (c, rocker, rod), (d, rocker, "ground")
        joints += [
            rx.spatial.Revolute(f"{name}{k}", i, j, point=point, axis=(0.0, 1.0, 0.0))
            for name, (point, i, j) in zip("abcd", pairs)
        ]
    machine = rx.Mechanism(bodies, joints, gravity=(0.0, 0.0, -9.81))
    report = rx.analyze(machine, rx.State(machine.reference, jnp.zeros(18 * legs)))
    with open("/proc/self/status") as file:  # not `ru_maxrss`, which begins at the peak of who starts a process
        peak = next(int(line.split()[1]) // 2**10 for line in file if line.startswith("VmHWM"))
    directions = len(report.releases[0].directions)
    print(report.rank, report.redundancy, report.freedom, directions, peak)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="address space and peak memory are asked of Linux")
def test_an_analysis_takes_memory_of_a_few_matrices():
    """Matrices of 216 coordinates and 240 rows hold 0.4 MB; all second derivatives at once asked for 18 GB."""
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(LEGS)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert run.returncode == 0, run.stderr[-2000:]
    *counts, megabytes = map(int, run.stdout.split())
    assert counts == [17 * 12, 3 * 12, 12, 3 * 12]  # the last: directions of the best release
    assert megabytes < 1000


def test_a_long_row_of_four_bars_is_analysed():
    """6 N + 3 coordinates, and a row fewer, all independent; all second derivatives at once asked for 1 TB."""
    mechanism = rx.mechanisms.n_four_bar(100)
    report = rx.analyze(mechanism, mechanism.state(1.0, rate=1.0))
    assert (report.rank, report.redundancy, report.freedom) == (602, 0, 1)


def test_as_much_self_stress_vanishes_as_there_are_forms():
    """At q = 0 four motions bend ten rows, one for each product of two of them; two more rows repeat one of these."""
    pairs = list(itertools.combinations_with_replacement(range(4), 2))

    def constraint(q, t, p):
        products = [q[i] * q[j] for i, j in pairs]
        return jnp.array([q[4], *products, 2 * products[1], products[1] + q[4]])

    system = rx.System(constraint, mass=jnp.ones(5))
    report = rx.analyze(system, rx.State(q=np.zeros(5), qd=np.zeros(5)))
    assert (report.rank, report.redundancy, report.freedom) == (1, 12, 4)
    assert report.singular_position and report.local_self_stress == 10


def test_releases_of_independent_groups_are_the_best_of_each():
    """15 groups of 6 rows with 3 self-stress states: all choices of one are 20, of all together 20^15."""
    generator = np.random.default_rng(2)
    blocks = [np.linalg.qr(generator.normal(size=(6, 3)))[0] for _ in range(15)]
    basis = np.zeros((90, 45))
    for k, block in enumerate(blocks):
        basis[6 * k : 6 * k + 6, 3 * k : 3 * k + 3] = block
    basis = basis @ np.linalg.qr(generator.normal(size=(45, 45)))[0]
    rows = tuple(f"joint {k}.row" for k in range(90))
    found = releases(basis, rows, ("force",) * 90, by_row=True)
    choices = [
        [abs(np.linalg.det(block[list(pick)])) for pick in itertools.combinations(range(6), 3)] for block in blocks
    ]
    assert found[0].determinant == pytest.approx(np.prod(np.max(choices, axis=1)), rel=1e-9)
    first, second = np.sort(choices, axis=1)[:, :-3:-1].T
    assert found[1].determinant == pytest.approx(np.prod(first) * np.max(second / first), rel=1e-9)
    for release in found:
        picked = [rows.index(row) for _, shares in release.directions for row in shares]
        assert release.determinant == pytest.approx(abs(np.linalg.det(basis[picked])), rel=1e-9)


def test_too_many_bodies_for_dense_matrices_are_refused_in_words(monkeypatch):
    monkeypatch.setattr(_pattern, "LARGEST_DENSE", 50)
    mechanism = rx.mechanisms.n_four_bar(5).sparse()
    state = mechanism.state(phi=0.8, rate=1.0)
    for ask in (rx.analyze, rx.solution_family, rx.frictional_solutions):
        with pytest.raises(rx.RedundaxError, match=r"at most 50 .* but has 65\. .*`factorize` tells rank"):
            ask(mechanism, state)
