"""The README's Python blocks run in their order, and print what it says."""

import contextlib
import io
import pathlib
import re

import pytest

import redundax as rx

README = (pathlib.Path(__file__).parents[2] / "README.md").read_text(encoding="utf8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
PRINTED = re.findall(r"```text\n(.*?)```", README, flags=re.DOTALL)
CLOSE = 2e-3  # of figures that a search finds


def numbers(text):
    return [float(each) for each in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


def test_blocks_run_and_print_what_is_said():
    scene, out = {}, io.StringIO()
    with contextlib.redirect_stdout(out):
        for block in BLOCKS:
            exec(compile(block, "README.md", "exec"), scene)
    printed = out.getvalue()
    assert "nan" not in printed
    (said,) = PRINTED
    shown = printed[-len(said) - 40 :]
    shown = shown[shown.index("MisfitBox") :]
    assert re.sub(r"[-\d.e]+", "", shown).split() == re.sub(r"[-\d.e]+", "", said).split()
    for found, expected in zip(numbers(shown), numbers(said), strict=True):
        assert abs(found - expected) <= CLOSE * abs(expected)
    assert (
        "`to_pandas()`" in README
        and "L force x on ram" in scene["rx"].solve(scene["press"], scene["state"]).to_pandas()
    )
    factor = rx.factorize(scene["press"], scene["state"])
    assert (int(factor.redundancy), int(factor.freedom)) == (2, 1)


def test_the_caption_says_what_the_bands_say():
    single, low, high, slow, fast = numbers(
        re.search(r"prints (\S+ N) of side force.*?(from .*?) N\. That.*?(from .*?) m/s", README, re.DOTALL).expand(
            r"\1 \2 \3"
        )
    )
    force, rate = (numbers(line)[-2:] for line in PRINTED[0].splitlines()[2:4])
    assert [low, high] == [round(each) for each in force]
    assert [slow, fast] == sorted(round(-each, 1) for each in rate)
    assert single == 5.5


def test_it_is_short():
    assert len(README.splitlines()) < 120


@pytest.mark.slow
def test_the_caption_says_what_the_hinges_may_carry():
    """Springs side by side: a third of the weight, and by its place against the others' a hinge's own share."""
    pattern = (
        r"a door of (\S+ N) each of three hinges, giving way by (\S+) µm/N and hung to\s(\S+) mm, .*? (from .*? N)\."
    )
    weight, compliance, off, low, high = numbers(re.search(pattern, README).expand(r"\1 \2e-6 \3e-3 \4"))
    assert weight == round(40 * 9.81)
    share = off * (1 - 1 / 3 + 2 / 3) / compliance
    assert [low, high] == [round(weight / 3 - share), round(weight / 3 + share)]
    door = rx.mechanisms.door(mass=40.0, lean=0.0)
    hinges = [f"hinge {k}" for k in (1, 2, 3)]
    fit = rx.MisfitBox(
        rx.ElasticJoints(door, {hinge: (compliance, 1e-3) for hinge in hinges}),
        {f"{hinge}.axial": (-off, off) for hinge in hinges},
    )
    names = [f"{hinge} force z on door" for hinge in hinges]
    bands = rx.band(door, rx.assemble(door, positions={"hinge 1.angle": 0.4}), names, fit)
    assert {*bands.lower.round()} == {low} and {*bands.upper.round()} == {high}
