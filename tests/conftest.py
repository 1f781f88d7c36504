"""Settings that hold for every test: float64, checked array shapes, compiled programs kept on disk.

Two of them must be made before anything else is imported, which is why this file imports late.
"""

import gc
import importlib.metadata
import os
import sys

# XLA reads its flags once, when the first backend starts. Subprocesses of tests inherit them.
# - On two-core CPUs, independent batched LAPACK calls in one compiled step can wait for good on the
#   thread pool that they run in (intermittent, seen with jaxlib 0.10). XLA starts such calls side by
#   side only under its concurrency-optimised scheduler; without it they run one after the other.
# - The tests spend most of their time in compiling programs that run for milliseconds. Without
#   optimisation, with XLA's older code generator and in one piece that takes a third of the time.
_jax = tuple(map(int, importlib.metadata.version("jax").split(".")[:2]))
_FLAGS = (
    "--xla_cpu_scheduler_type=CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED",
    "--xla_backend_optimization_level=0",
    *(["--xla_cpu_use_fusion_emitters=false"] if _jax < (0, 11) else []),  # XLA aborts at flags that it has dropped
    "--xla_cpu_parallel_codegen_split_count=1",
    # Nor are loops run often enough to pay for a look at what each repeats: a tenth of the time of motions.
    "--xla_disable_hlo_passes=while-loop-simplifier,while-loop-invariant-code-motion,"
    "while-loop-expensive-invariant-code-motion",
)
_given = os.environ.get("XLA_FLAGS", "").split()
_names = {flag.split("=")[0] for flag in _given}
os.environ["XLA_FLAGS"] = " ".join([*_given, *(flag for flag in _FLAGS if flag.split("=")[0] not in _names)])
# Nor does anyone read where in the source an instruction of a program comes from, a tenth of the time.
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")
# The tests run in a process for each core; threads of OpenBLAS beside them wait by spinning, 50 times slower.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["REDUNDAX_CACHE"] = "off"  # tests leave the user's folder alone

import beartype.typing  # noqa: F401 (the expression below needs it loaded)
import hypothesis
import jax
import jaxtyping
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)

# With REDUNDAX_CHECKS=on every annotated function and class of the package is checked: each call by beartype, with
# the axis names of one signature bound together by jaxtyping. The default run does without, in a fifth less time.
if "redundax" in sys.modules:
    raise pytest.UsageError(
        "redundax must not be imported before tests/conftest.py, but it was (by a plugin, say), so "
        "its annotations would go unchecked. Import it in the test files instead."
    )
# The hook takes the checker as an expression. It sees methods one by one, without their class, so
# `Self` means nothing to it and is let through; an int may stand for a float, as pyright allows.
if os.environ.get("REDUNDAX_CHECKS", "off") == "on":
    jaxtyping.Array = jax.Array | np.ndarray | np.generic  # functions of known numbers run on those of NumPy
    jaxtyping.install_import_hook(
        "redundax",
        "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True, "
        "hint_overrides=beartype.FrozenDict({beartype.typing.Self: object})))",
    )

# A first example compiles and later ones do not, so no time limit per example makes sense.
hypothesis.settings.register_profile("redundax", deadline=None)
if hypothesis.settings.get_current_profile_name() == "default":
    hypothesis.settings.load_profile("redundax")

MAPS = 16_000  # memory maps that a process may hold before a module, about 3 GB of programs; Linux allows 65,530
SLOW_TIMEOUT = 1800  # seconds; must stay below `faulthandler_timeout` in pyproject.toml


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled programs from one run to the next.

    They lie in pytest's own cache directory, so that `--cache-clear` drops them too, unless
    JAX_COMPILATION_CACHE_DIR names another place. The variables are set as well as the options, for
    the workers of pytest-xdist and the subprocesses of tests.
    """
    if getattr(config, "cache", None) is None:  # `-p no:cacheprovider`
        return
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(config.cache.mkdir("jax")))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")  # most are of one operation, and all share
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    jax.config.update(
        "jax_persistent_cache_min_compile_time_secs",
        float(os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"]),
    )


# Tracing makes millions of short-lived objects beside the many that stay; looking through all of them takes a sixth of
# the time of a run.
gc.set_threshold(200_000, 50, 100)


def pytest_collection_finish() -> None:
    """Let the collector leave alone what all tests share."""
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give slow tests a longer time limit, unless they name one of their own."""
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(SLOW_TIMEOUT))


@pytest.fixture(autouse=True, scope="session")
def programs_never_take_over() -> None:
    """Known numbers are computed however often they are asked for, so that no test depends on those before it."""
    from redundax._tools import _numbers

    _numbers.OFTEN, _numbers.OFTEN_PUT, _numbers.LONG = sys.maxsize, sys.maxsize, float("inf")


@pytest.fixture(scope="module", autouse=True)
def _programs_of_one_module():
    """Modules share what the ones before have compiled, until that holds many memory maps."""
    yield
    if _memory_maps() > MAPS:
        jax.clear_caches()


@pytest.fixture
def programs_at_once(monkeypatch):
    """Nothing of a model is computed by NumPy, so that each structure of it is a program to count."""
    monkeypatch.setattr("redundax._tools._numbers.FEW", 0)


@pytest.fixture
def programs(programs_at_once):
    """Names of the programs that are compiled from here on."""
    names = []

    def listen(event, _, **about):
        if event.endswith("backend_compile_duration"):
            names.append(about.get("fun_name"))

    jax.clear_caches()
    jax.monitoring.register_event_duration_secs_listener(listen)
    yield names
    jax.monitoring.unregister_event_duration_listener(listen)


def _memory_maps() -> float:
    """Of this process; not known but on Linux."""
    try:
        with open("/proc/self/maps") as lines:
            return sum(1 for _ in lines)
    except OSError:
        return float("inf")


@pytest.fixture
def float32():
    """Run one test in JAX's default precision.

    Arrays that wider fixtures or module constants made before it stay float64.
    """
    with jax.enable_x64(False):
        yield
