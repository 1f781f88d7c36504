"""Success means finite: every public call that gives results, and every number in what it gives.

One block on a guide that stands there twice serves all calls. With sound data each gives finite numbers; with any of
its data spoiled it refuses, or says so in its result, and in a batch that sample alone does.
"""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import redundax as rx

R = rx.RESULTS
slow = pytest.mark.slow
# Public functions that give no results of a mechanism: maps of numbers that are there.
MAPS = {
    *("closure_in_units", "in_units", "solution_from_units", "state_in_units", "heated", "misfit"),
    *("dependence_in_units", "minimum_norm_parameters", "minimum_norm_parameters_in_units"),
    "parametrised_multipliers",
    "load_model",  # of a file, which it refuses or closes
}
# Infinite by their docstrings: no singular value dropped, no fold met, no step made, nothing that friction must hold,
# no outer bound known.
INFINITE = ("gap", "fold", "nearest_singularity", "margin", "outer_lower", "outer_upper")


def rubbing(loads, rate, sense, memory, state, p):
    return -p["mu"] * jnp.abs(loads[0] + 2 * loads[1])[None] * sense


def block(mu=0.1, inertia=1.0, push=3.0, gravity=10.0) -> rx.System:
    """A mass of 1 kg on a spring of 1 N/m and a rough guide, pushed by 3 N; y = 0 stands there twice."""
    return rx.System(
        _guide, _mass, _load, {"inertia": inertia, "push": push, "gravity": gravity}, n=2, rows="force",
        friction=rx.Friction(_slip, rubbing, [0, 1], ["linear"], {"mu": mu}),
    )  # fmt: skip


def _guide(q, t, p):
    return jnp.stack([q[1], 2 * q[1]])


def _mass(q, t, p):
    return p["inertia"] * jnp.eye(2)


def _load(q, qd, t, p):
    return jnp.stack([p["push"] - q[0], -p["gravity"]])


def _slip(q, t, p):
    return q[:1]


def at(x=0.5, y=0.0, dx=1.0, dy=0.0, t=0.0) -> rx.State:
    return rx.State(jnp.stack([x, y]), jnp.stack([dx, dy]), t)


Case = tuple[dict[str, float], dict[str, float]]  # of the block, and of its state
WEIGHTLESS = {"push": 0.0, "gravity": 0.0}
SOUND: dict[str, Case] = {
    "slipping": ({}, {}),
    "slipping back": ({}, {"dx": -2.0}),
    "later": ({}, {"t": 3.0}),
    "no loads": (WEIGHTLESS, {"x": 0.0}),
    "no friction": ({"mu": 0.0}, {}),
}
REST: dict[str, Case] = {
    "let go": ({}, {"dx": 0.0}),
    "held": ({"push": 1.0}, {"dx": 0.0}),
    "no loads": (WEIGHTLESS, {"x": 0.0, "dx": 0.0}),
}
BAD = (np.nan, np.inf)
OF_STATE: dict[str, Case] = {f"{name} {bad}": ({}, {name: bad}) for name in ("x", "y", "dx", "dy", "t") for bad in BAD}
OF_FRICTION: dict[str, Case] = {f"mu {bad}": ({"mu": bad}, {}) for bad in BAD}
OF_EQUATIONS: dict[str, Case] = {
    **{f"{name} {bad}": ({name: bad}, {}) for name in ("inertia", "push", "gravity") for bad in BAD},
    "no mass": ({"inertia": 0.0}, {}),
    "negative mass": ({"inertia": -1.0}, {}),
    "off the guide": ({}, {"y": 0.1}),
    "velocity off the guide": ({}, {"dy": 0.3}),
}
SPOILED = OF_STATE | OF_FRICTION | OF_EQUATIONS
SOFT = rx.Compliance(jnp.ones(2))
CLOSURES = {
    **{f"compliance {bad}": rx.Compliance(jnp.array([bad, 1.0])) for bad in BAD},
    **{f"misfit {bad}": rx.Compliance(jnp.ones(2), jnp.array([bad, 0.0])) for bad in BAD},
}


def simulated(system, state, closure):
    return rx.simulate(system, state, state.t + 0.5, ts=state.t + jnp.array([0.2, 0.5]), closure=closure, throw=False)


def along(system, state, closure):
    return rx.analyze_along(system, jax.tree.map(lambda *x: jnp.stack(x), at(), state), closure=closure)


def stability(system, state, closure):
    return rx.stability(system, state, rx.solve(system, state, closure=closure, throw=False), closure)


def swept(system, state, closure):
    return rx.solve(system, state, closure=closure, solver=rx.FixedPoint(), throw=False)


def opened(system, state, _):
    return rx.solve(system, state, closure=None, solver=rx.Newton(), x0=0.0, throw=False)


BOX = rx.AmplitudeBox({"0": (-1.0, 1.0)})
Call = Callable[[rx.System, rx.State, Any], Any]
OF_CLOSURE: dict[str, Call] = {
    "solve": lambda system, state, closure: rx.solve(system, state, closure=closure, throw=False),
    "solve by sweeps": swept,
    "simulate": simulated,
    "frictional_solutions": lambda system, state, closure: rx.frictional_solutions(system, state, closure=closure),
    "analyze": lambda system, state, closure: rx.analyze(system, state, closure=closure),
    "analyze_along": along,
    "stability": stability,
}
CALLS: dict[str, Call] = {
    "factorize": lambda system, state, _: rx.factorize(system, state),
    "assemble": lambda system, state, _: rx.assemble(system, state.q, state.qd, state.t),
    "solve from x0": opened,
    "solution_family": lambda system, state, _: rx.solution_family(system, state, samples=5, starts=3),
    "band": lambda system, state, _: rx.band(system, state, None, BOX, samples=8, starts=3),
    "unit_certificate": lambda system, state, _: rx.units.unit_certificate(system, state),
    **OF_CLOSURE,
}
AT_REST: dict[str, Call] = {
    "sticking": lambda system, state, closure: rx.sticking(system, state, closure, samples=8, starts=3),
    "band": lambda system, state, closure: rx.band(system, state, None, closure),
    "band_along": lambda system, state, closure: rx.band_along(system, [state, state], None, closure),
    "limit_load": lambda system, state, closure: rx.limit_load(system, state, [1.0, 0.0], closure),
    "simulate": simulated,
}
ELSEWHERE = {
    "drive",
    "assemble_along",
    "with_peaks",
    "grip",
    "lift_off",
    "check",
    "keep_programs",
}  # of joints that follow laws, wheels, contacts, logs, no machine at all
OF_BATCHES = {"study", "ensemble", "tolerance_study", "identify"}
DEAR = ("simulate", "analyze_along", "solution_family")  # compile for long, or repeat what others do
each_call = pytest.mark.parametrize("call", [pytest.param(name, marks=slow if name in DEAR else ()) for name in CALLS])


def test_no_public_function_is_left_out():
    public = {**vars(rx), **vars(rx.units)}
    functions = {name for name, thing in public.items() if name[0].islower() and callable(thing)}
    assert functions - MAPS == {name.split()[0] for name in CALLS | AT_REST} | OF_BATCHES | ELSEWHERE


def numbers(x: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """All floating-point numbers in a result, with the names of the fields that hold them."""
    if isinstance(x, xarray.Dataset):
        x = {name: x[name].values for name in x.variables}
    elif dataclasses.is_dataclass(x):
        x = {field.name: getattr(x, field.name) for field in dataclasses.fields(x)}
    if isinstance(x, dict):
        for key, value in x.items():
            yield from numbers(value, str(key))
    elif isinstance(x, list | tuple):
        for value in x:
            yield from numbers(value, name)
    elif isinstance(x, float | np.ndarray | jax.Array) and np.asarray(x).dtype.kind in "fc":
        yield name, np.asarray(x)


def assert_finite(result: Any, *, but: tuple[str, ...] = ()) -> None:
    for name, values in numbers(result):
        if name in but:
            continue
        known = ~np.isnan(values) if name.rsplit(".", 1)[-1] in INFINITE else np.isfinite(values)
        assert known.all(), name


def given(result: Any) -> bool:
    """Whether a result holds numbers; where it says that it does not, those of motions and loads are NaN."""
    if isinstance(result, rx.types.Solution | rx.types.Trajectory) and result.result not in (R.successful, R.stuck):
        for part in (result.acceleration, result.multipliers, result.friction):
            assert np.isnan(part).all()
        return False
    if isinstance(result, rx.types.Bands | rx.types.BandPath):
        parts = (result,) if isinstance(result, rx.types.Bands) else result.bands
        return not any(part.empty for part in parts)
    if isinstance(result, rx.types.Factorisation):
        return bool(result.result == R.successful)
    reports = result.reports if isinstance(result, rx.types.MotionReport) else [result]
    return not any(getattr(report, "problem", "") for report in reports)


def outcome(call: Call, case: Case, closure: rx.AbstractClosure = SOFT) -> Any:
    """What a call gives; None where it refuses in a sentence of ours, or its result says that it holds no numbers."""
    system, state = case
    try:
        result = call(block(**system), at(**state), closure)
    except rx.RedundaxError:  # any other error is a crash
        return None
    return result if given(result) else None


@each_call
def test_sound_data_give_finite_numbers(call):
    for name, case in SOUND.items():
        result = outcome(CALLS[call], case)
        assert result is not None, name
        assert call == "unit_certificate" or any(numbers(result))
        assert_finite(result)


@pytest.mark.parametrize("call", [pytest.param(name, marks=slow if name in DEAR else ()) for name in AT_REST])
def test_a_mechanism_at_rest_has_finite_numbers(call):
    for name, case in REST.items():
        result = outcome(AT_REST[call], case)
        if name == "let go" and call.startswith("band"):
            assert result is None  # no loads hold it
            continue
        assert result is not None, name
        stays = getattr(result, "result", R.successful) == R.stuck
        assert_finite(result, but=("multipliers", "friction") if stays else ())


@each_call
def test_spoiled_data_are_refused(call):
    cases = {"factorize": OF_STATE | OF_EQUATIONS, "assemble": OF_STATE}.get(call, SPOILED)
    for name, case in cases.items():
        assert outcome(CALLS[call], case) is None, name
    if call in OF_CLOSURE:
        for name, closure in CLOSURES.items():
            assert outcome(CALLS[call], ({}, {}), closure) is None, name


def test_spoiled_data_are_refused_at_rest():
    for name, (system, state) in SPOILED.items():
        assert outcome(AT_REST["sticking"], (system, {"dx": 0.0} | state)) is None, name


# In batches ----------------------------------------------------------------------------------

CASES = [*SOUND.values(), *SPOILED.values()]
GOOD = np.arange(len(CASES)) < len(SOUND)


def of_all(call: Callable[..., Any]) -> tuple[Any, dict[str, jax.Array]]:
    """The call on all cases in one batch, a tenth of their numbers each."""
    plain = {
        "mu": 0.1,
        "inertia": 1.0,
        "push": 3.0,
        "gravity": 10.0,
        "x": 0.5,
        "y": 0.0,
        "dx": 1.0,
        "dy": 0.0,
        "t": 0.0,
    }
    rows = [plain | system | state for system, state in CASES]
    samples = {name: jnp.array([row[name] for row in rows]) for name in plain}
    return jax.jit(jax.vmap(lambda sample: call(**sample)))(samples), samples


def with_state(call: Callable[[rx.System, rx.State], Any]) -> Callable[..., Any]:
    def of_sample(mu, inertia, push, gravity, x, y, dx, dy, t):
        return call(block(mu, inertia, push, gravity), at(x, y, dx, dy, t))

    return of_sample


def only(batch: Any, k: int) -> Any:
    return jax.tree.map(lambda x: x[k], batch)


@pytest.mark.parametrize(
    "call",
    [
        CALLS["solve"],
        pytest.param(simulated, marks=slow),
        pytest.param(swept, marks=slow),
        pytest.param(opened, marks=slow),
    ],
)
def test_a_spoiled_sample_of_a_batch_is_told_and_touches_no_other(call):
    batch, _ = of_all(with_state(lambda system, state: call(system, state, SOFT)))
    np.testing.assert_array_equal(batch.result == R.successful, GOOD)
    for k in range(len(CASES)):
        result = only(batch, k)
        assert given(result) == GOOD[k]
        if GOOD[k]:
            assert_finite(result)
    alone = outcome(call, CASES[1])
    for name in ("acceleration", "multipliers", "friction"):
        np.testing.assert_allclose(getattr(batch, name)[1], getattr(alone, name), rtol=1e-9)


def test_a_spoiled_guess_of_a_batch_is_not_assembled():
    batch, _ = of_all(with_state(lambda system, state: rx.assemble(system, state.q, state.qd, state.t)))
    spoiled = [set(state.values()) & {np.inf} or any(np.isnan(x) for x in state.values()) for _, state in CASES]
    for k, bad in enumerate(spoiled):
        assert np.isnan(batch.q[k]).all() and np.isnan(batch.qd[k]).all() if bad else np.isfinite(batch.q[k]).all()


@pytest.mark.slow
def test_a_study_tells_its_spoiled_samples():
    run = with_state(lambda system, state: rx.solve(system, state, closure=SOFT))
    _, samples = of_all(with_state(lambda system, state: state.t))
    data = rx.study(run, samples, system=block())
    np.testing.assert_array_equal(data["result"] == 0, GOOD)
    for name in ("acceleration", "multipliers", "friction"):
        assert np.isfinite(data[name][GOOD]).all() and np.isnan(data[name][~GOOD]).all()


def spoiled_above(limit: float, value: jax.Array) -> jax.Array:
    return jnp.where(value > limit, jnp.nan, value)


@slow
def test_an_ensemble_is_finite_where_a_motion_counts():
    def run(mu, push):
        return simulated(block(mu, push=push), at(), SOFT)

    for mus, good in ((jnp.array([0.1, np.nan]), [True, False]), (jnp.array([np.nan, np.nan]), [False, False])):
        with pytest.warns(UserWarning, match=f"{2 - sum(good)} of 2 motions did not get to the end"):
            data = rx.ensemble(run, {"mu": mus, "push": jnp.array([3.0, 4.0])}, system=block())
        np.testing.assert_array_equal(data["solved"], good)
        for name in ("q", "qd", "acceleration", "multipliers", "friction"):
            assert np.all(data[f"{name}_count"] == sum(good))
            assert np.all(np.isfinite(data[f"{name}_band"]) == any(good))


@slow
def test_a_tolerance_study_is_finite_where_samples_fail():
    def build(push, mu):
        return rx.solve(block(mu, push=spoiled_above(3.1, push)), at(), closure=SOFT)

    varies = {"mu": rx.Normal(0.1, 0.01)}
    with pytest.warns(UserWarning, match="have no solution and are left out"):
        data = rx.tolerance_study(build, {"push": rx.Normal(3.0, 0.1), **varies}, samples=64, system=block())
    np.testing.assert_array_equal(data["solved"], data["push"] <= 3.1)
    for name in ("nominal", "mean", "std", "percentiles", "gradient", "share"):
        assert np.all(np.isfinite(data[name])), name
    with pytest.raises(rx.NoSolutionError, match="not finite"):
        rx.tolerance_study(build, {"push": rx.Normal(3.2, 0.1), **varies}, samples=64, system=block())


@slow
@pytest.mark.parametrize("limit", [np.inf, 3.1, -np.inf])
def test_an_identification_is_finite_or_has_a_problem(limit):
    """What is predicted is NaN where the push is above the limit: nowhere, for some starts, everywhere."""

    def predict(push, mu):
        return rx.solve(block(mu, push=spoiled_above(limit, push)), at(), closure=SOFT).acceleration[:1]

    varies = {"push": rx.Normal(3.0, 0.5), "mu": rx.Normal(0.1, 0.02)}
    found = rx.identify(predict, [1.3], varies, noise=0.01, starts=4, throw=False)
    assert found.converged == (not found.problem)
    assert found.converged == np.isfinite(found.chi_square)
    if found.converged:
        assert_finite(found)
    assert found.converged or limit < np.inf
    assert found.problem or limit > -np.inf
    with pytest.raises(rx.RedundaxError, match="`noise` must be positive and finite"):
        rx.identify(predict, [1.3], varies, noise=np.inf)


@slow
@pytest.mark.parametrize("options", [{"max_steps": 3}, {"max_phases": 1}])
def test_a_motion_that_ends_early_is_finite_up_to_its_end(options):
    times = jnp.linspace(0.0, 4.0, 9)
    run = rx.simulate(block(), at(), 4.0, ts=times, throw=False, **options)
    assert run.result in (R.steps_exhausted, R.phases_exhausted)
    reached = np.asarray(times) <= float(run.stats.end)
    assert 0 < reached.sum() < 9
    for part in (run.q, run.qd, run.acceleration, run.multipliers, run.friction, run.sense):
        assert np.isfinite(part[reached]).all() and np.isnan(part[~reached]).all()
