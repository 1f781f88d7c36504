"""Which slow tests a commit runs, in small repositories."""

import itertools
import os
import shutil
import subprocess

import pytest
import share

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="asks git")
SLOW = "import pytest\n\n@pytest.mark.slow\ndef test_a():\n    pass\n"
FOLDERS = {"motion": 2, "plot": 8, "solve": 8}
FILES = [f"tests/{folder}/test_{k}.py" for folder, count in FOLDERS.items() for k in range(count)]


@pytest.fixture
def commit(tmp_path):
    """Makes a commit of some files, so many hours after the first."""

    def made(hours, **files):
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        date = {f"GIT_{who}_DATE": f"{1_700_006_400 + 3600 * hours} +0000" for who in ("AUTHOR", "COMMITTER")}
        for line in ("init -q", "add -A", "-c user.name=a -c user.email=a commit -q --allow-empty -m a"):
            subprocess.run(["git", *line.split()], cwd=tmp_path, env=os.environ | date, check=True)
        return share.chosen(tmp_path, 3)

    made(0, **dict.fromkeys(FILES, SLOW), **{"tests/plot/test_quick.py": "", "redundax/_motion/_a.py": ""})
    return made


def test_commits_of_a_day_run_every_file(commit):
    runs = [commit(100 + hours)[0] for hours in (0, 4, 9)]
    assert sorted(itertools.chain(*runs)) == FILES
    assert [len(files) for files in runs] == [6, 6, 6]


def test_what_changed_runs_too(commit):
    uses = SLOW + "from redundax._bodies import _body\nfrom racks import rods\n"
    commit(100, **{"tests/plot/test_1.py": uses})
    changes = [
        ("tests/solve/test_6.py", SLOW + "\n", {"tests/solve/test_6.py"}),
        ("redundax/_motion/_deep/_a.py", "1", set(FILES[:2])),
        ("redundax/_bodies/_b.py", "1", {"tests/plot/test_1.py"}),
        ("tests/support/racks.py", "1", {"tests/plot/test_1.py"}),
        ("docs/page.md", "1", set()),
    ]
    for k, (path, text, touched) in enumerate(changes):
        files, said = commit(192 + 100 * k, **{path: text})
        assert set(files) == touched | set(FILES[k % 3 :: 3])
        assert said.endswith(f"share {k % 3 + 1} of 3, 6 files, and {len(touched)} files of what changed in 6 hours")
    assert "tests/plot/test_1.py" in commit(604, **{"redundax/_bodies/_b.py": "2"})[0]
    assert commit(606)[1].endswith("and 1 files of what changed in 6 hours")


def test_who_changes_all_runs_half_a_share_more(commit):
    files, said = commit(100, **dict.fromkeys(FILES, SLOW + "\n"))
    assert 6 <= len(files) <= 9
    assert said.endswith(f"and 3 files of what changed in 6 hours ({18 - len(files)} more wait)")


def test_a_clone_without_history_runs_a_share(commit, tmp_path):
    commit(100, **{FILES[0]: SLOW + "\n"})
    subprocess.run(["git", "clone", "-q", "--depth", "1", f"file://{tmp_path}", tmp_path / "clone"], check=True)
    files, said = share.chosen(tmp_path / "clone", 3)
    assert files in [FILES[k::3] for k in range(3)]
    assert "and 0 files of what changed" in said


def test_one_share_is_all(commit, tmp_path):
    assert share.chosen(tmp_path, 1)[0] == FILES
