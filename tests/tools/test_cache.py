"""Compiled programs that are kept: a second run takes them from the folder, and compiles none."""

import os
import pathlib
import subprocess
import sys

import jax
import pytest

from redundax import keep_programs
from redundax._tools import _cache

FILE = """
import jax.numpy as jnp
import redundax as rx

system = rx.System(mass=jnp.eye(2), constraint=lambda q, t, _: jnp.stack([q[0] + q[1], 2 * q[0] + 2 * q[1]]))
pair = system, rx.State(jnp.zeros(2), jnp.ones(2) * jnp.array([1.0, -1.0]))
"""
COUNT = """
import sys, jax
from redundax.__main__ import process
found = []
jax.monitoring.register_event_listener(lambda event, **_: found.append(event.rpartition("/")[2]))
status = process()
print(found.count("cache_hits"), found.count("cache_misses"), file=sys.stderr)
sys.exit(status)
"""
OPTIONS = "jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs"
OPTIONS = (*OPTIONS, "jax_persistent_cache_min_entry_size_bytes")


@pytest.fixture
def settings(monkeypatch):
    """JAX without a cache of its own, for one test."""
    before = {option: getattr(jax.config, option) for option in OPTIONS}
    jax.config.update("jax_compilation_cache_dir", None)
    monkeypatch.delenv("REDUNDAX_CACHE", raising=False)
    yield
    for option, value in before.items():
        jax.config.update(option, value)


def folder():
    return jax.config.jax_compilation_cache_dir


def run(tmp_path, **environment):
    """Exit status, output, and what stands on standard error line by line, of a process of its own."""
    file = tmp_path / "pair.py"
    file.write_text(FILE)
    given = {k: v for k, v in os.environ.items() if not k.startswith(("JAX_COMPILATION", "JAX_PERSISTENT"))}
    done = subprocess.run(
        [sys.executable, "-c", COUNT, "analyze", f"{file}:pair"],
        env={**given, **environment},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr.splitlines()


def test_a_second_run_compiles_nothing(tmp_path):
    kept = tmp_path / "kept"
    first, second = (run(tmp_path, REDUNDAX_CACHE=str(kept)) for _ in range(2))
    assert first[:2] == second[:2]
    assert first[0] == 0
    hits, misses = ([int(word) for word in done[2][-1].split()] for done in (first, second))
    assert hits[0] == 0 < hits[1]
    assert misses == [hits[1], 0]
    assert len(list(kept.glob("*-cache"))) == hits[1]


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_fails_no_command(tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("a file")
    status, out, error = run(tmp_path, REDUNDAX_CACHE=str(taken))
    assert status == 0
    assert "1 redundant" in out
    assert len(error) == 2
    assert "REDUNDAX_CACHE" in error[0]
    assert taken.read_text() == "a file"


@pytest.mark.parametrize(
    ("platform", "variable", "place"),
    [
        ("linux", "XDG_CACHE_HOME", "redundax"),
        ("linux", "HOME", ".cache/redundax"),
        ("darwin", "HOME", "Library/Caches/redundax"),
        ("win32", "LOCALAPPDATA", "redundax/Cache"),
    ],
)
def test_folders_of_the_platforms(settings, monkeypatch, tmp_path, platform, variable, place):
    monkeypatch.setattr(_cache.sys, "platform", platform)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    keep_programs()
    assert folder() == str(tmp_path / place)
    assert (tmp_path / place).is_dir()


def test_a_script_names_its_folder(settings, monkeypatch, tmp_path):
    monkeypatch.setenv("REDUNDAX_CACHE", "off")
    keep_programs(tmp_path / "own")
    assert folder() == str(tmp_path / "own")
    jax.config.update("jax_compilation_cache_dir", None)
    (tmp_path / "taken").write_text("a file")
    with pytest.warns(UserWarning, match="Name another folder as `folder`"):
        keep_programs(tmp_path / "taken")
    assert folder() is None


def test_off(settings, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("REDUNDAX_CACHE", "off")
    keep_programs()
    assert folder() is None
    assert not list(tmp_path.iterdir())


def test_what_jax_is_told_holds(settings, monkeypatch, tmp_path):
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "of_jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 7.0)
    monkeypatch.setenv("REDUNDAX_CACHE", str(tmp_path / "ours"))
    keep_programs()
    assert folder() == str(tmp_path / "of_jax")
    assert jax.config.jax_persistent_cache_min_compile_time_secs == 7
    assert not (tmp_path / "ours").exists()


def test_a_user_without_a_home_has_no_folder(settings, monkeypatch, capsys):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(_cache.sys, "platform", "linux")
    monkeypatch.setattr(pathlib.Path, "home", nowhere)
    keep_programs()
    assert folder() is None
    assert not capsys.readouterr().err


def test_the_oldest_programs_go_first(settings, monkeypatch, tmp_path):
    monkeypatch.setattr(_cache, "LIMIT", 25)
    monkeypatch.setenv("REDUNDAX_CACHE", str(tmp_path))
    for age, name in enumerate(("jit_new-cache", "jit_older-cache", "jit_oldest-cache", "letter.txt")):
        (tmp_path / name).write_bytes(bytes(10))
        os.utime(tmp_path / name, (10**9 - age, 10**9 - age))
    keep_programs()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["jit_new-cache", "jit_older-cache", "letter.txt"]
