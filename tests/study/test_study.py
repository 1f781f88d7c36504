"""Studies in chunks, files, devices and processes, against NumPy and closed forms."""

import json
import os
import signal
import socket
import subprocess
import sys

import jax.numpy as jnp
import netCDF4
import numpy as np
import pytest

import redundax as rx
from redundax._study import _study

X = np.linspace(-1.0, 2.0, 10)
PAIRS = np.random.default_rng(0).normal(size=(10, 2))


def run(x, pair):
    return {"square": x * x, "above": x > 0, "nested": {"sums": pair + x, "count": jnp.floor(x).astype(int)}}


def expected():
    return {
        "x": X,
        "pair": PAIRS,
        "square": X * X,
        "above": X > 0,
        "nested.sums": PAIRS + X[:, None],
        "nested.count": np.floor(X),
    }


def same(found, size=10):
    assert set(found) == set(expected())
    for name, values in expected().items():
        np.testing.assert_array_equal(found[name], values[:size], err_msg=name)
        assert found[name].dtype.kind == ("i" if name == "nested.count" else values.dtype.kind)


def study(function=run, samples=None, **options):
    return rx.study(function, {"x": X, "pair": PAIRS} if samples is None else samples, **{"chunk": 4, **options})


@pytest.mark.parametrize("chunk", [1, 4, 10, 64])
def test_chunks_of_any_size(chunk):
    found = study(chunk=chunk)
    same(found)
    assert found.attrs == {"samples": 10, "done": 10}


def test_float32(float32, tmp_path):
    found = study(path=tmp_path / "single.nc")
    assert (found.x.dtype, found.square.dtype) == (np.float64, np.float32)
    np.testing.assert_array_equal(found.square, X.astype(np.float32) ** 2)


def stopped(after):
    """What tells progress, interrupted after some chunks."""

    def told(steps, *_):
        for number, step in enumerate(steps):
            if number == after:
                raise KeyboardInterrupt
            yield step

    return told


def test_file_goes_on_where_it_stopped(tmp_path, monkeypatch):
    path = tmp_path / "half.nc"
    with monkeypatch.context() as patch:
        patch.setattr(_study, "told", stopped(2))
        with pytest.warns(UserWarning, match="stopped after 8 of 10 samples"):
            half = study(path=path)
    same(half, 8)
    assert half.done == 8
    begun = []
    monkeypatch.setattr(_study, "told", lambda steps, *_: begun.extend(steps) or steps)
    same(study(path=path))  # although `half` has been read from the file
    same(study(path=path))
    assert begun == [8]


def test_interrupt_in_memory(monkeypatch):
    monkeypatch.setattr(_study, "told", stopped(1))
    with pytest.warns(UserWarning, match="stopped after 4 of 10"):
        same(study(), 4)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_python_loses_ends_a_study(monkeypatch):
    """As it does one that comes while an object is deleted: it prints it, and goes on."""

    class Deleted:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def told(steps, *_):
        for number, step in enumerate(steps):
            yield step
            if number == 0:
                Deleted()

    monkeypatch.setattr(_study, "told", told)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # workers of pytest-xdist ignore the signal
    try:
        with pytest.warns(UserWarning, match="stopped after 8 of 10"):
            same(study(), 8)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_statistics_of_a_stopped_study_are_not_given(monkeypatch):
    monkeypatch.setattr(_study, "told", stopped(1))
    with pytest.warns(UserWarning, match="stopped after 4 of 16"), pytest.raises(KeyboardInterrupt):
        rx.tolerance_study(lambda x: {"square": x * x}, {"x": rx.Normal(1.0, 0.1)}, samples=16, chunk=4)


@pytest.mark.parametrize(
    ("function", "samples", "message"),
    [
        (run, {"x": X, "pair": 2 * PAIRS}, "something else than this study"),
        (lambda x, pair: {"square": x * x}, None, "something else than this study"),
        (lambda x, pair: run(x, pair) | {"square": (1 + 1e-6) * x * x}, None, "other values of 'square'"),
    ],
)
def test_file_of_another_study_is_refused(function, samples, message, tmp_path):
    study(path=tmp_path / "one.nc")
    with pytest.raises(rx.RedundaxError, match=message):
        study(function, samples, path=tmp_path / "one.nc")
    same(study(path=tmp_path / "one.nc"))


def test_file_of_a_study_that_failed_at_once_is_taken(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(_study, "told", stopped(0))
        with pytest.warns(UserWarning, match="stopped after 0 of 10"):
            study(lambda x, pair: {"other": x * x}, path=tmp_path / "new.nc")
    same(study(path=tmp_path / "new.nc"))


def cut(path):
    path.write_bytes(path.read_bytes()[:-100])


def changed(path):
    """The last of the first samples beyond the first chunk, by one bit."""
    content = path.read_bytes()
    place = content.index(np.array(X[4:8] ** 2).tobytes()) + 24
    path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])


def rewritten(path):
    with netCDF4.Dataset(path, "a") as data:
        data["nested.sums"][9, 1] += 1e-9


def scaled(path):
    """Readers of netCDF multiply by an attribute of this name."""
    with netCDF4.Dataset(path, "a") as data:
        data["square"].scale_factor = 2.0


def longer(path):
    with netCDF4.Dataset(path, "a") as data:
        data.done = "10"


def endless(path):
    """The first text in the file's heap becomes free space of no size: HDF5 steps over it for ever."""
    content = path.read_bytes()
    place = content.index(b"GCOL") + 16
    path.write_bytes(content[:place] + bytes(16) + content[place + 16 :])


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda path: path.write_bytes(b""), "study.nc is no netCDF file.* delete the file"),
        (lambda path: path.write_text("a,b\n1,2\n"), "study.nc is no netCDF file.* delete the file"),
        (cut, "study.nc cannot be read .*cut off or damaged. Delete the file"),
        (changed, "study.nc was changed or damaged.* written at samples 4 to 7. Delete the file"),
        (rewritten, "study.nc was changed or damaged.* written at samples 8 to 9. Delete the file"),
        (scaled, "study.nc was changed or damaged.* written at variable 'square'. Delete the file"),
        (longer, "study.nc was changed or damaged.* written at attribute 'done'. Delete the file"),
        (endless, "study.nc cannot be read .*cut off or damaged. Delete the file"),
    ],
)
def test_a_damaged_file_is_told(harm, message, tmp_path):
    study(path=tmp_path / "study.nc")
    harm(tmp_path / "study.nc")
    with pytest.raises(rx.RedundaxError, match=message):
        study(path=tmp_path / "study.nc")
    (tmp_path / "study.nc").unlink()
    same(study(path=tmp_path / "study.nc"))


def test_labels_that_changed_place_are_told(tmp_path):
    """Both are as long, so that the file stays a sound one."""
    axis = rx.Axis(("left_end", "right_at"), ("linear", "linear"))
    system = rx.System(lambda q, t, p: q[:1], jnp.ones(2), coordinates=axis, rows="force")
    options = {"samples": {"x": X}, "system": system, "path": tmp_path / "study.nc"}
    with study(lambda x: {"q": jnp.stack([x, -x])}, **options) as found:
        np.testing.assert_array_equal(found.q.sel(coordinate="left_end"), X)
    content = (tmp_path / "study.nc").read_bytes()
    places = [content.index(name.encode()) for name in axis.labels]
    changed = bytearray(content)
    for place, name in zip(places, reversed(axis.labels), strict=True):
        changed[place : place + len(name)] = name.encode()
    (tmp_path / "study.nc").write_bytes(changed)
    with pytest.raises(rx.RedundaxError, match=r"study.nc was changed .* written at variable 'coordinate'"):
        study(lambda x: {"q": jnp.stack([x, -x])}, **options)


def test_a_folder_is_no_file(tmp_path):
    (tmp_path / "study.nc").mkdir()
    with pytest.raises(rx.RedundaxError, match=r"study.nc cannot be opened .*Choose another"):
        study(path=tmp_path / "study.nc")


HELD = "import netCDF4, sys; data = netCDF4.Dataset(sys.argv[1], 'a'); print('open', flush=True); sys.stdin.read()"


@pytest.mark.skipif(os.name != "posix", reason="asks for the lock as Unix knows it")
def test_a_file_that_is_open_elsewhere_is_told(tmp_path):
    path = tmp_path / "study.nc"
    study(path=path)
    with subprocess.Popen([sys.executable, "-c", HELD, path], stdin=-1, stdout=-1, text=True) as other:
        assert other.stdout.readline() == "open\n"
        with pytest.raises(rx.RedundaxError, match=r"study.nc is open in another program .* Close it there"):
            study(path=path)
        other.communicate()
    same(study(path=path))


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files")
def test_a_full_disk_is_told_and_the_study_goes_on(tmp_path, monkeypatch):
    resource = pytest.importorskip("resource")
    before, begun, x = resource.getrlimit(resource.RLIMIT_FSIZE), [], np.arange(1000.0)

    def room(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))

    def told(steps, *_):
        for step in steps:
            begun.append(step)
            if step == 300:
                room(1000)
            yield step

    def full():
        return rx.study(lambda x: {"y": x + jnp.arange(10)}, {"x": x}, chunk=100, path=tmp_path / "study.nc")

    words = "Argument `path`: .*study.nc cannot be written.*MB are free.*Make room, or choose another"
    try:
        room(20_000)  # of 48,000 bytes
        with pytest.raises(rx.RedundaxError, match=words):
            full()
        room(before[0])
        monkeypatch.setattr(_study, "told", told)
        with pytest.raises(OSError, match=words) as later:
            full()
    finally:
        room(before[0])
    assert not isinstance(later.value, rx.RedundaxError)
    assert "call the study again: 300 of 1000 samples are done" in str(later.value)
    monkeypatch.setattr(_study, "told", lambda steps, *_: begun.append(steps[0]) or steps)
    np.testing.assert_array_equal(full().y, x[:, None] + np.arange(10))
    assert begun == [0, 100, 200, 300, 300]


def whirl(speed, drift):
    """A mass on a rod held twice, without load: its acceleration is speed^2 towards the middle, without drift."""

    def rod(q, t, p):
        row = q @ q - 1
        return jnp.stack([row, 2 * row])

    rows = rx.Axis(("rod", "again"), ("force", "force"))
    system = rx.System(rod, jnp.ones(2), coordinates=rx.Axis(("x", "y"), ("linear", "linear")), rows=rows)
    return system, rx.State(q=[1.0, 0.0], qd=jnp.stack([drift, speed]))


def test_solutions_have_names_and_outcomes(tmp_path):
    speed, drift = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([0.0, 0.0, 1.0, 0.0, 0.0])
    options = {"system": whirl(1.0, 0.0)[0], "path": tmp_path / "whirl.nc"}
    samples = {"speed": speed, "drift": drift}
    with study(lambda speed, drift: rx.solve(*whirl(speed, drift)), samples, **options) as found:
        right = drift == 0
        np.testing.assert_allclose(found.acceleration.sel(coordinate="x")[right], -(speed[right] ** 2), rtol=1e-14)
        assert np.all(np.isnan(found.acceleration[~right]))
        assert found.multipliers.dims == ("sample", "row")
        assert list(found.row.values) == ["rod", "again"]
        assert list(found.coordinate_kind.values) == ["linear", "linear"]
        names = np.array(found.result.flag_meanings.split())[found.result.values]
        assert list(names) == [("successful" if r else "inadmissible_velocity") for r in right]
        np.testing.assert_array_equal(found["stats.redundancy"], np.ones(5))


@pytest.mark.parametrize(
    ("function", "samples", "options", "message"),
    [
        (run, {}, {}, "`samples` must hold arrays of one length"),
        (run, {"x": X, "pair": PAIRS[:5]}, {}, "`samples` must hold arrays of one length"),
        (run, {"x": X[:0], "pair": PAIRS[:0]}, {}, "`samples` must hold arrays of one length"),
        (run, {"x": 1.0, "pair": PAIRS}, {}, "`samples` must hold arrays of one length"),
        (lambda sample: {"y": sample}, {"sample": X}, {}, "may be called 'sample', as a dimension is"),
        (lambda x: {"y": jnp.stack([x, x]), "y_0": x}, {"x": X}, {}, "may be called 'y_0', as a dimension is"),
        (run, {"x": X + 1j}, {}, "`samples` must hold real numbers of at least 32 bits, but 'x'"),
        (lambda x: {"x": x}, {"x": X}, {}, "No output may be called 'x'"),
        (lambda x: x, {"x": X}, {}, "must return a dict of arrays or a `Solution`"),
        (lambda x: {}, {"x": X}, {}, "must return arrays, but returns none"),
        (lambda x: {"y": x + 1j}, {"x": X}, {}, "'y' has dtype complex128"),
        (run, None, {"chunk": 0}, "`chunk` must be a whole number from 1 on"),
        (run, None, {"path": "study.txt"}, "`path` must end in .nc"),
        (run, None, {"path": "nowhere/study.nc"}, "lie in a folder that exists"),
    ],
)
def test_bad_input(function, samples, options, message):
    with pytest.raises(rx.RedundaxError, match=message):
        study(function, samples, **options)


@pytest.mark.parametrize("package", ["xarray", "netCDF4"])
def test_missing_package_names_the_extra(package, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf'{package}: pip install "redundax\[study\]"'):
        study(path=tmp_path / "new.nc")


# ----------------------------------------------------------------------- in processes of their own

SPREAD = """
import json, os, sys
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
path, processes, number, port = json.loads(sys.argv[1])
if processes > 1:
    jax.distributed.initialize(f"localhost:{port}", processes, number)
import redundax as rx
from redundax._study import _study

mechanism, real, devices = rx.mechanisms.wojtyra2020(), _study.fetch, set()

def fetched(values):
    devices.add(len(values.sharding.device_set))
    return real(values)

_study.fetch = fetched

def run(phi):
    return {"acceleration": rx.solve(mechanism, mechanism.state(phi=phi, rate=0.0)).acceleration}

samples = {"phi": np.linspace(0.5, 1.0, 18)}
mesh = jax.make_mesh((2, 2), ("board", "core"))
found = rx.study(run, samples, system=mechanism, chunk=7, mesh=mesh, path=path)
refused = []
for change, threads in ((1, 8), (0, 4 // processes)):
    os.environ["PJRT_NPROC"] = str(threads)
    try:
        rx.study(run, {"phi": samples["phi"] + change}, system=mechanism, chunk=7, mesh=mesh, path=path)
    except rx.RedundaxError as error:
        refused.append(str(error))
crank = found.acceleration.sel(coordinate="1.phi").values
print(json.dumps({"devices": [*devices], "done": int(found.done), "refused": refused, "crank": crank.tolist()}))
"""


def begin(path, processes=1, number=0, port=0):
    """A process with its share of four devices."""
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count={4 // processes}"
    return subprocess.Popen(
        [sys.executable, "-c", SPREAD, json.dumps([str(path), processes, number, port])],
        env={**os.environ, "XLA_FLAGS": flags, "PJRT_NPROC": "8"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    try:
        out, error = process.communicate(timeout=500)
    finally:
        process.kill()
    assert process.returncode == 0, error
    return json.loads(out.splitlines()[-1])


def check_spread(found):
    """All four devices took part; the crank falls from rest as by hand, with the inertia m l^2 (88 + 72 cos^2 phi)."""
    assert (found["devices"], found["done"]) == ([4], 18)
    other_study, few_threads = found["refused"]
    assert "study" in other_study and "PJRT_NPROC" in few_threads
    cosine, length, gravity = np.cos(np.linspace(0.5, 1.0, 18)), 0.1, 10.0
    falls = -42 * np.sqrt(2) * gravity / length * cosine / (88 + 72 * cosine**2)
    np.testing.assert_allclose(found["crank"], falls, rtol=1e-12)


@pytest.mark.slow
def test_four_devices_share_the_samples(tmp_path):
    check_spread(ended(begin(tmp_path / "spread.nc")))


@pytest.mark.slow
def test_two_processes_share_the_samples(tmp_path):
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    both = [begin(tmp_path / "spread.nc", 2, number, port) for number in range(2)]
    for process in both:
        check_spread(ended(process))


GROWTH = """
import sys
import jax.numpy as jnp, numpy as np
import redundax as rx

def run(x):
    return {"y": x + jnp.arange(100)}

def peak():
    return next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))

x = np.arange(400_000, dtype=np.float32)
rx.study(run, {"x": x[:4000]}, chunk=4000, path=f"{sys.argv[1]}/small.nc")
before = peak()
rx.study(run, {"x": x}, chunk=4000, path=f"{sys.argv[1]}/large.nc" if sys.argv[2] == "file" else None)
print(peak() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="reads the peak of memory from /proc")
@pytest.mark.parametrize(("where", "least", "most"), [("file", 0, 30), ("memory", 100, 300)])
def test_memory_does_not_grow_with_a_file(where, least, most, tmp_path):
    """160 MB of results."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_ENABLE_X64"}
    process = [sys.executable, "-c", GROWTH, tmp_path, where]
    out = subprocess.run(process, env=environment, capture_output=True, text=True, timeout=1000, check=True).stdout
    assert least <= float(out) < most
