"""The referee of a log of joint loads."""

import argparse
import json
import pathlib
import warnings

from .._bodies._mechanism import Mechanism
from .._check._check import check
from .._models._formats import MODELS
from .._models._model import Model, load_model
from .._models._series import Series
from .._system._state import State
from .._tools._errors import RedundaxError
from .._tools._progress import stage
from ..plot._check import check as picture
from ._file import FileError, check_system, load, writing
from ._output import show, tell

_SOFT = (
    "MuJoCo makes loops springs (solref, solimp), and starts them at rest: that is in what is off. A stiffer loop and "
    "a shorter timestep come nearer."
)


def check_file(arguments: argparse.Namespace) -> int:
    """Print what of a log is right; the exit status says whether all is."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            mechanism, state, log, whole = _opened(arguments)
            with stage("comparing loads"):
                report = check(
                    mechanism, log, axes=arguments.axes, drives=arguments.drive or None, q=state.q, rtol=arguments.rtol
                )
    except (RedundaxError, RuntimeError, OSError) as error:
        raise FileError(" ".join(str(error).split())) from error
    told = list(dict.fromkeys(str(each.message) for each in caught if each.category is UserWarning))
    about = [f"warning: {each}" for each in told]
    about += [] if whole else ["warning: something that constrains is not read, so nothing here is proved."]
    if arguments.json:
        show(json.dumps({"model": arguments.system, "whole": whole, "warnings": told, **report.to_dict()}))
    else:
        show("\n".join([*about, str(report), *([_SOFT] if arguments.run and not report.is_right else [])]))
    if arguments.png:
        with writing(arguments.png):
            picture(report).savefig(arguments.png)
        tell(f"drawn: {arguments.png}")
    if not whole:
        return 4
    return 0 if report.is_right else 3


def _opened(arguments: argparse.Namespace) -> tuple[Mechanism, State, Series | pathlib.Path, bool]:
    """The machine, its position, the log, and whether all that constrains is there."""
    path, log = arguments.system, arguments.log
    if arguments.run and log is not None:
        raise FileError("Argument `--run` makes a log. Leave it out, or the log.")
    if pathlib.Path(path).suffix.lower() not in MODELS:
        check_system(arguments)
        if log is None:
            raise FileError(f"Argument `LOG` must be given for '{path}'. Name a file of CSV.")
        system, state = load(path)
        return _mechanism(path, system), state, pathlib.Path(log), True
    model = load_model(path, arguments.closures, keyframe=arguments.keyframe)
    mechanism = model.driven if model.described.motors else model.mechanism
    return mechanism, model.state, _log(arguments, model), model.is_whole


def _mechanism(path: str, system: object) -> Mechanism:
    if not isinstance(system, Mechanism):
        raise FileError(f"'{path}' must be a `Mechanism`, with joints, but is {type(system).__name__}. Name another.")
    return system


def _log(arguments: argparse.Namespace, model: Model) -> Series | pathlib.Path:
    if arguments.run:
        return model.run(arguments.run)
    if arguments.log is not None:
        return pathlib.Path(arguments.log)
    if model.series is None:
        spoiled = [note.partition(" that ")[2].rstrip(".") for note in model.notes if note.startswith("stored run")]
        what = spoiled[0] if spoiled else "stores no run"
        raise FileError(f"'{arguments.system}' {what}. Name a log, a file of CSV, or give --run SECONDS.")
    return model.series
