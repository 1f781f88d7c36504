"""Singular values that repeat exactly or vanish exactly, with derivatives by every parameter.

Derivatives of the singular vectors do not exist there; those of accelerations and multipliers do, at constant rank.
The truth is a central difference at 50 digits, with a step of 1e-17.
"""

import jax.numpy as jnp
from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import ZERO, wojtyra, wojtyra_parameters

import redundax as rx

from .._case import Case
from .._derivative import Path
from .._library import linear_constraint, linear_load
from .._linear import linear
from ._common import closed, irregular

FAMILY = "repeated"
ROUTES = ("decided", "declared", "compliance", "factorize", "forward", "reverse")
ROWS = {
    "each row twice, one thrice": (((1, 0), (0, 1), (1, 0)), ("1", "0")),
    "the same, turned": (((1, 0), (0, 1), (1, 0)), ("3/5", "4/5")),
    "rows of zeros": (((0, 0), (1, 0), (0, 0)), ("1", "0")),
    "all combinations equal": (((1, 1), (1, 1), (1, 1)), ("1", "0")),
}


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    names = list(ROWS)[1:2] if quick else list(ROWS)
    return [*(of_rows(name) for name in names), *(of_paper(friction) for friction in (False, True)[quick:])]


@exactly
def of_rows(name: str) -> Case:
    """A linear system with the given combinations and independent rows."""
    combinations, (c, s) = ROWS[name][0], exact.exact(ROWS[name][1])
    free = ((c, s, ZERO, ZERO, ZERO, ZERO), (-s, c, ZERO, ZERO, ZERO, ZERO))
    parameters = {
        "mass": exact.exact(("1", "2", "1/2", "3", "1", "3/2")),
        "load": irregular(6, 5),
        "free": free,
        "combinations": exact.exact(combinations),
        "gamma": irregular(len(free)),
    }
    rows = len(free) + len(combinations)
    path = Path(parameters, lambda p: linear(p), from_rows)
    return Case(FAMILY, name, linear, closed(parameters, rows), ROUTES, path=path)


def from_rows(p: dict) -> tuple[rx.System, rx.State]:
    """The linear system of traced parameters."""
    free, gamma = p["free"], p["gamma"]
    combinations = jnp.reshape(p["combinations"], (-1, free.shape[0]))
    parameters = {
        "jacobian": jnp.concatenate([free, combinations @ free]),
        "gamma": jnp.concatenate([gamma, combinations @ gamma]),
        "load": p["load"],
    }
    n, m = free.shape[1], free.shape[0] + combinations.shape[0]
    return rx.System(linear_constraint, p["mass"], linear_load, parameters, m=m), rx.State(jnp.zeros(n), jnp.zeros(n))


@exactly
def of_paper(friction: bool) -> Case:
    """The paper's mechanism by length, mass, friction, gravity, angle and rate; coordinates follow the length."""
    given = {"length": "1/10", "mass": 1, "mu_rho": "1/50", "gravity": 10, "phi": "3/4", "rate": 1}
    given = {name: exact.exact(value) for name, value in given.items()}
    if not friction:
        del given["mu_rho"]
    name = "the paper's mechanism" + (", friction" if friction else "")
    path = Path(given, lambda p: wojtyra(paper_data(p)), from_paper)
    return Case(
        FAMILY, name, wojtyra, paper_data(given), ("decided", "forward", "reverse"), friction=friction, path=path
    )


@exactly
def paper_data(p: dict) -> dict:
    """The parameters of `wojtyra` from those of `rx.mechanisms.wojtyra2020`."""
    changes = {name: p[name] for name in ("phi", "rate", "gravity")}
    return wojtyra_parameters(p["length"], p["mass"], mu_rho=(p.get("mu_rho", mp.mpf(0)),) * 4, **changes)


def from_paper(p: dict) -> tuple[rx.Mechanism, rx.State]:
    """The library's own mechanism of traced parameters."""
    mechanism = rx.mechanisms.wojtyra2020(
        length=p["length"], mass=p["mass"], mu_rho=p.get("mu_rho"), gravity=p["gravity"]
    )
    return mechanism, mechanism.state(p["phi"], rate=p["rate"])
