"""Who waits for a compiler at a terminal is told of it, and nobody else."""

import io
import sys

import jax
import jax.numpy as jnp
import numpy as np

import redundax as rx
from redundax._tools import _waiting


class Terminal(io.StringIO):
    def isatty(self):
        return True


def at_a_terminal(monkeypatch):
    """A function that gives what stands on the terminal; pytest's own streams come back after fixtures."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(_waiting, "PATIENCE", 0.0)
    return terminal.getvalue


def assembled(stiffness):
    """A system that no other test compiles."""

    def constraint(q, t, _):
        return jnp.stack([q[0] - jnp.tanh(stiffness * q[1])])

    return rx.assemble(rx.System(mass=jnp.eye(2), constraint=constraint), np.zeros(2))


def test_a_line_names_the_call(monkeypatch):
    told = at_a_terminal(monkeypatch)
    assembled(1.25)
    assert "redundax: assemble: compiling for 0 s so far" in told()
    assert ("keep_programs" in told()) == (not jax.config.jax_compilation_cache_dir)


def test_no_word_of_others_nor_of_quick_ones(monkeypatch):
    told = at_a_terminal(monkeypatch)
    jax.jit(lambda x: jnp.sinh(x) * 3.5)(1.0)
    monkeypatch.setattr(_waiting, "PATIENCE", 60.0)
    assembled(2.25)
    assert not told()


def test_no_word_without_a_terminal(capsys, monkeypatch):
    monkeypatch.setattr(_waiting, "PATIENCE", 0.0)
    assembled(3.25)
    assert not capsys.readouterr().err


def test_a_search_names_what_ends_it(monkeypatch):
    told = at_a_terminal(monkeypatch)
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    rx.limit_load(mechanism, mechanism.state(phi=0.8, rate=0.0), {"1.phi": 1.0}, nodes=300)
    assert "redundax: limit_load: 0 s so far: linear programmes, at most 300 for each range of amounts" in told()
