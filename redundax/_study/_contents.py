"""What a netCDF file holds beside its numbers: dimensions, variables, their labels and attributes.

As a program, `python _contents.py FILE` prints it as JSON. It imports nothing of the package, so it starts at once.
"""

import contextlib
import json
import math
import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import netCDF4

_CPU_SECONDS = 2  # a sound file with a thousand labels takes a hundredth of it


def contents(data: "netCDF4.Dataset") -> dict[str, object]:
    """By name, what can be compared: sizes of dimensions, variables with all texts in them, attributes of the file."""
    found: dict[str, object] = {f"dimension {name!r}": len(dim) for name, dim in data.dimensions.items()}
    for name, variable in data.variables.items():
        shape = [str(variable.dtype), *variable.dimensions]
        texts = variable[:].tolist() if variable.dtype is str else None
        found[f"variable {name!r}"] = [shape, texts, _attributes(variable)]
    return found | {f"attribute {name!r}": value for name, value in _attributes(data).items()}


def _attributes(item: "netCDF4.Dataset | netCDF4.Variable") -> dict[str, object]:
    values = {name: item.getncattr(name) for name in item.ncattrs()}
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in values.items()}


def _main() -> None:
    import netCDF4

    with contextlib.suppress(ImportError):  # not Unix
        import resource

        limit = math.ceil(time.process_time()) + _CPU_SECONDS
        resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    with netCDF4.Dataset(sys.argv[1]) as data:
        found = contents(data)
        for variable in data["checks"].variables.values() if "checks" in data.groups else ():
            variable[:]
    print(json.dumps(found))


if __name__ == "__main__":
    _main()
