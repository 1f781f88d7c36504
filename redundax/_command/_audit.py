"""The audit of a model from a file."""

import argparse
import contextlib
import json
import pathlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from .._bodies._mechanism import Mechanism
from .._equations._assemble import assemble
from .._equations._factorize import factorize_dense
from .._finite_elements._body_loads import as_calculix, as_csv, body_loads
from .._models._audit import Audit, audit
from .._models._audit_page import About, audit_page
from .._models._choice import listed
from .._models._examine import examine
from .._models._fix import Fix, fix
from .._models._formats import MODELS, not_a_model
from .._models._model import STOPS, Model, contents, load_model
from .._models._repair import language
from .._models._repair_page import wrapped
from .._solve._solve import solve
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._progress import stage
from .._tools._words import ended, printable
from ._audit_html import check_pictures, write_page
from ._copy import check_copy
from ._file import FileError, blaming, check_system, load, writing
from ._output import show, tell
from ._stops import NoStops, Stops, stops_of, stops_page

_POSITIONS = 3  # beside that of the file
_REACH = 0.3  # of them, rad or lengths of the mechanism
_MOST = 4  # joints named
_MANY, _TOO_MANY = 150, 3000  # bodies: about a minute of work; 2.6 GB a matrix


def audit_file(arguments: argparse.Namespace) -> int:
    """Audit a model; the exit status says what was found."""
    if arguments.html:
        check_pictures()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        system, state, found, about, mended, says, stops, lines = _found(arguments)
    told = list(dict.fromkeys(str(each.message) for each in caught if each.category is UserWarning))
    heading = [
        *_heading(arguments.system, about, arguments.keyframe is not None),
        *(f"warning: {each}" for each in told),
    ]
    page = audit_page(found, about, lines=lines, language=says, allowed=arguments.allow, everything=arguments.all)
    rest = [*(stops_page(stops) if stops else ()), *_next(arguments, found), *_notes(about, stops is not None)]
    text = "\n".join([*heading, "", page, *([""] if rest else []), *rest])
    data = {"model": arguments.system, **(about or {}), "warnings": told, **found.to_dict()}
    data |= {"stops": stops} if stops else {}
    show(json.dumps(data) if arguments.json else text)
    if mended:
        tell(str(mended))
    if arguments.loads:
        _write_loads(arguments.loads, system, state)
    if arguments.html:
        write_page(arguments.html, printable(f"Audit of {arguments.system}"), printable(text), system, state, found)
        tell(f"written: {arguments.html}")
    if not (found.is_decided and (about is None or about["whole"])):
        return 4
    return 3 if found.figures[0] > arguments.allow else 0


def _write_loads(file: pathlib.Path, system: AbstractSystem, state: State) -> None:
    try:
        found = body_loads(cast(Mechanism, system), state, solve(system, state))
    except (RedundaxError, NoSolutionError) as error:
        raise FileError(f"Argument `--loads`: {error}") from error
    with writing(file):
        file.write_text(as_calculix(found) if file.suffix == ".inp" else as_csv(found), encoding="utf8")
    tell(f"written: {file}")


class _Found(NamedTuple):
    """What was audited, the audit, and what is to be said of the file."""

    system: AbstractSystem
    state: State
    audit: Audit
    about: About | None
    fix: Fix | None = None
    language: str = ""
    stops: Stops | NoStops | None = None
    lines: Mapping[tuple[str, ...], Sequence[str]] = MappingProxyType({})


def _found(arguments: argparse.Namespace) -> _Found:
    path = arguments.system
    kind = pathlib.Path(path).suffix.lower()
    if "://" in path:
        raise FileError(f"'{path}' is an address. Fetch the file first, and name it.")
    if path and pathlib.Path(path).is_dir():
        raise FileError(f"'{path}' is a folder. Name a file in it, or FILE.py:NAME.")
    if what := not_a_model(path):
        raise FileError(f"'{path}' {ended(what)}")
    if ":" not in path and kind not in (*MODELS, ".py"):
        raise FileError(f"'{path}' must be a model, {', '.join(MODELS)}, or FILE.py:NAME. Check its ending.")
    if arguments.release and not arguments.fix:
        raise FileError("Argument `--release` says what `--fix` is to free. Give --fix FILE too.")
    if kind not in MODELS:
        check_system(arguments)
    if arguments.fix:
        with _clearly(path):
            check_copy(path, arguments.closures, arguments.fix)
    if kind not in MODELS:
        with blaming(path):
            system, state = load(path)
            with stage("finding what is unique"):
                return _Found(system, state, audit(system, state, _elsewhere(system, state)), None)
    with _clearly(path):
        with stage("reading the model and closing its loops"):
            model = load_model(path, arguments.closures, keyframe=arguments.keyframe)
        _check_size(len(model.mechanism.names.bodies))
        with stage("finding what is unique"):
            found = examine(model, _POSITIONS)
        mended = fix(model, found, arguments.fix, arguments.release) if arguments.fix else None
        says, lines = language(model), {}
        for edit in (edit for each in found.repairs for choice in each.choices for edit in choice.edits):
            lines[edit.rows] = says.lines(model, edit)
        stops = stops_of(model, model.state) if arguments.stops else None
        return _Found(model.mechanism, model.state, found, _about(model), mended, says.name, stops, lines)


def _check_size(bodies: int) -> None:
    """Tell early how large a model is, or refuse it."""
    size = 8 * (6 * bodies) ** 2 / 1e9
    if bodies > _TOO_MANY:
        raise FileError(
            f"{bodies} bodies that move: an audit has matrices of {size:.0f} GB, several at once. Cut out the part "
            "whose loops you ask for, or fix to each other what need not move."
        )
    if bodies > _MANY:
        tell(f"redundax: {bodies} bodies that move: matrices of {size:.1g} GB, and minutes to hours.")


@contextlib.contextmanager
def _clearly(path: str) -> Iterator[None]:
    """Tell in a line why a model cannot be read or closed."""
    try:
        yield
    except FileError:
        raise
    except Exception as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise FileError(why if path in why else f"'{path}': {why}") from error


def _elsewhere(system: AbstractSystem, state: State) -> list[State]:
    """States at rest at other positions, that random motions lead to."""
    factor, random, found = factorize_dense(system, state), np.random.default_rng(1), []
    columns = np.asarray(factor.scaling.coordinates)
    for _ in range(_POSITIONS):
        step = columns * (np.asarray(factor.split.motion) @ random.normal(size=columns.size))
        size = float(np.abs(step / columns).max()) or 1.0
        guess = system.retract(state.q, jnp.asarray(_REACH * float(factor.length) / size * step))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            other = assemble(system, guess, t=state.t, throw=False)
        found += [other] if bool(jnp.all(jnp.isfinite(other.q))) else []
    return jax.device_get(found) if factor.freedom else []


def _about(model: Model) -> About:
    bodies = len(model.mechanism.names.bodies)
    worst = max(model.misfits.values(), default=0.0)
    left = max(model.tree.misfits(model.positions).values(), default=0.0)
    return {
        "bodies": bodies,
        "joints": {kind: list(names) for kind, names in model.joints.items()},
        "loops": {kind: list(names) for kind, names in model.loops.items()},
        "position": f"the keyframe '{model.keyframe}'" if model.keyframe else "the position of the file",
        "keyframe": model.keyframe or None,
        "keyframes": list(model.keyframes),
        "misfit_in_file": worst,
        "misfit": left,
        "moved": model.moved,
        "found_at_random": not model.is_near,
        "outside_limits": [limit._asdict() for limit in model.outside],
        "whole": model.is_whole,
        "left_out": list(model.notes),
        "soft": model.described.is_soft,
    }


def _heading(path: str, about: About | None, asked: bool) -> list[str]:
    if not about:
        return [path]
    first = f"{path}: {contents(about['bodies'], about['joints'], about['loops'])}"
    return [first, *(line for each in _position(about, asked) for line in wrapped(each))]


def _position(about: About, asked: bool) -> Iterator[str]:
    """Which position the audit begins from, where that is not plainly that of the file within its limits."""
    where, keys = about["position"], [key for key in about["keyframes"] if key != about["keyframe"]]
    if about["keyframe"]:
        why = "" if asked else ": the position of the file is outside joint limits, or does not close"
        yield f"It begins from {where}{why}."
    if about["moved"]:
        far = sorted(about["moved"].items(), key=lambda each: -each[1])
        names = listed([f"{name} by {size:.2g}" for name, size in far], _MOST)
        how = ", from random positions, the nearest that closes" if about["found_at_random"] else ""
        whole = f"{where[:1].upper()}{where[1:]}"
        yield (
            f"{whole} does not close the loops (off by {about['misfit_in_file']:.1g} m or rad). Joints were moved to "
            f"close them{how}: {names} (rad or m)."
        )
    if about["outside_limits"]:
        names = listed(
            [f"{x['joint']} at {x['position']:.4g}, limit {x['limit']:.4g}" for x in about["outside_limits"]]
        )
        yield f"Outside joint limits there: {names} (rad or m). Motions lead no farther beyond."
    if keys:
        yield f"Keyframe{'s' * (len(keys) > 1)} of the file: {listed(keys)}; --keyframe NAME begins from one."


def _notes(about: About | None, are_stops_asked: bool) -> list[str]:
    """What the model here is without."""
    soft = ["Loops are taken as rigid, where MuJoCo has springs."] if about and about["loops"] and about["soft"] else []
    notes = [" ".join(note.split()) for note in (about["left_out"] if about else ())]
    notes = [note for note in notes if not (are_stops_asked and note.startswith(STOPS))]
    told = [*soft, *(note if " is left out" in note else f"left out: {note}" for note in notes)]
    return [line for each in told for line in wrapped(each, subsequent_indent="    ")]


def _next(arguments: argparse.Namespace, found: Audit) -> list[str]:
    """What to type next, for a model that can be mended."""
    kind = pathlib.Path(arguments.system).suffix.lower()
    if kind not in MODELS or arguments.fix or not found.figures[0] or not found.is_decided:
        return []
    copy = kind.replace(".usdz", ".usda")  # whose copy is a layer over it
    fix = f"--fix COPY{copy} writes a mended copy; " if any(each.choices for each in found.repairs) else ""
    every = "" if arguments.all else "--all lists all releases; "
    return wrapped(f"Next: {fix}{every}--html PAGE.html shows it.")
