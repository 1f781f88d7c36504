"""Which files of slow tests a commit runs: those of what changed, and one share of the others, in turn.

    python tests/support/share.py [--of 6] [--all]      with --all, of all tests

Prints them, a line each, and on stderr which share it is and why. Files are dealt in their order, so that a share has
some of each folder, and the time of the commit says whose turn it is, which goes on every TURN hours: however many
commits are merged at once, none waits for longer than a day.

Changed is what differs from the commit HOURS ago, where the clone has one. A test file goes with it if it changed
itself, or if its folder, its name or its imports name a changed part of the package, of the tests' support or of the
repository. These are at most half a share more, files that changed themselves first: who changes all waits for the
turns.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path, PurePosixPath

HOURS = 6  # what is merged at once was written within some hours
TURN = 4  # hours, about those from one merge to the next


def git(root: Path, *arguments: str) -> str:
    """What git says; nothing where it is not there or fails."""
    try:
        return subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True).stdout.strip()
    except OSError:
        return ""


def turn(root: Path, of: int) -> int:
    """The number of the share that the commit runs, from 0."""
    return int(git(root, "log", "-1", "--format=%ct") or 0) // (3600 * TURN) % of


def changed(root: Path) -> set[str]:
    """Paths that differ from the commit HOURS before; none where the clone has no such commit."""
    now = int(git(root, "log", "-1", "--format=%ct") or 0)
    before = git(root, "rev-list", "-1", f"--before={now - 3600 * HOURS}", "HEAD")
    return set(git(root, "diff", "--name-only", before, "HEAD").splitlines()) if before else set()


def parts_of(paths: set[str]) -> set[str]:
    """Names of the parts of the repository that hold these files, as tests may import or be called by."""
    found = set()
    for path in paths:
        first, *rest = (part.strip("_") for part in PurePosixPath(path).with_suffix("").parts)
        if first in ("redundax", "benchmarks") and rest:
            found.add(rest[0])
        elif (first, *rest[:1]) == ("tests", "support"):
            found |= {*rest[1:]}
        elif first != "tests":
            found.add(first.lower())
    return found


def names_of(file: Path) -> set[str]:
    """Folder, name and imported names of a test file."""
    imports = re.findall(r"^(?:from|import) .*", file.read_text(encoding="utf8"), re.M)
    words = {word.strip("_") for line in imports for word in re.findall(r"\w+", line)}
    return words | {file.parent.name, file.stem.removeprefix("test_")}


def chosen(root: Path, of: int, mark: str = "mark.slow") -> tuple[list[str], str]:
    """The files, and in words which they are."""
    every = sorted(file for file in (root / "tests").rglob("test_*.py") if mark in file.read_text(encoding="utf8"))
    paths, number = changed(root), turn(root, of)
    parts, most = parts_of(paths), len(every) // (2 * of)
    own = [file for file in every if file.relative_to(root).as_posix() in paths]
    touched = [*own, *(file for file in every if file not in own and names_of(file) & parts)]
    taken = {*touched[:most], *every[number::of]}
    words = (
        f"{'slow ' if mark else ''}tests: share {number + 1} of {of}, {len(every[number::of])} files, and "
        f"{len(touched[:most])} files of what changed in {HOURS} hours"
    )
    left = len(set(touched) - taken)
    return [file.relative_to(root).as_posix() for file in every if file in taken], words + f" ({left} more wait)" * (
        left > 0
    )


def main() -> None:
    """Print the files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--of", type=int, default=6, help="number of shares; 1 runs all (default 6)")
    parser.add_argument("--all", action="store_true", help="files of all tests, not of slow ones alone")
    given = parser.parse_args()
    files, words = chosen(Path(__file__).resolve().parents[2], given.of, "" if given.all else "mark.slow")
    print(words, file=sys.stderr)
    print("\n".join(files))


if __name__ == "__main__":
    main()
