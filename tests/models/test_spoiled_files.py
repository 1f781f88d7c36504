"""Files that chance has spoiled: each is read, or refused by the package in one line."""

import importlib.util
import random
import re

import numpy as np
import pytest
import test_asmt
import test_sdf
import usd

import redundax
from redundax._models._build import mechanism_of
from redundax._models._formats import describe
from redundax._models._tree import Tree
from redundax._models._urdf import closures_of

pytest.importorskip("mujoco")
pytest.importorskip("yaml")

NEEDS_USD = pytest.mark.skipif(importlib.util.find_spec("pxr") is None, reason="without usd-core")
SHAPES = "".join(
    [
        usd.HEAD.format(1, 1, "Z"),
        usd.body(
            "b",
            "0, 0, 0",
            inside=usd.shape(
                'def Mesh "s"',
                f"point3f[] points = [{usd.BOX}]\n int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]\n"
                f"int[] faceVertexIndices = [{usd.FACES}]",
            )
            + usd.shape(
                'def Capsule "t"',
                'double radius = 0.2\n double height = 0.6\n uniform token axis = "Z"\n float physics:density = 500',
            ),
        ),
        usd.joint("h", "PhysicsRevoluteJoint", "", "/b"),
    ]
)
CROSS = "<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"

BAR = """<mujoco>
  <compiler angle="radian"/><default><joint axis="0 1 0" damping="0.1"/><geom type="capsule" size="0.01"/></default>
  <asset><mesh name="nowhere" file="nowhere.stl"/></asset>
  <worldbody>
    <body name="crank"><joint name="A" armature="0.1"/><geom fromto="0 0 0 0 0 0.1"/><geom type="mesh" mesh="nowhere"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B" stiffness="2" springref="0.3"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.2"/></body>
      </body>
    </body>
    <body name="cart" pos="0 2 0"><joint name="S" type="slide"/><joint name="T" axis="0 0 1"/>
      <geom fromto="0 0 0 0 0 1"/></body>
    <body name="glass" pos="0 3 0"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 2 2.5"/></body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="A" coef="0.5"/><joint joint="S" coef="2"/></fixed></tendon>
  <equality>
    <connect name="D" body1="rocker" body2="world" anchor="0 0 -0.2"/>
    <weld name="hung" body1="glass" body2="cart"/>
    <joint name="cam" joint1="S" joint2="T" polycoef="0 0.5 0.25 -1 0"/>
  </equality>
  <actuator><motor name="pull" tendon="both"/><position name="turn" joint="T"/></actuator>
</mujoco>
"""
LINK = (
    '<link name="{}"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
HINGE = (
    '<joint name="{0}" type="revolute"><parent link="frame"/><child link="{1}"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="5" velocity="5"/></joint>'
)
DOOR = "".join(['<robot name="door">', *map(LINK.format, ("frame", "door", "leaf")), HINGE.format("low", "door")])
DOOR += HINGE.format("high", "leaf") + '<transmission name="t"><joint name="low"/></transmission></robot>'
LOOPS = "closed_loop: [[door, leaf]]\ntype: [6d]\nname_mot: [low]\njoint_name: [high]\njoint_type: [SPHERICAL]\n"


def spoiled(text, chance):
    """Something cut off, left out, put twice, exchanged, or replaced by nonsense."""
    tags, values = re.findall(r"<[^>]*>", text) or [text], re.findall(r'"[^"]*"', text) or [text]
    numbers, words = re.findall(r"-?\d+\.?\d*", text) or ["1"], re.findall(r"[A-Za-z_]{3,}", text)
    tag, other, value, word = (chance.choice(each) for each in (tags, tags, values, words))
    place = chance.randrange(len(text))
    nonsense = chance.choice(["nan", "1e999", "x", "", "-1", "0", "1e300", "1e-300", "<i>", "a&amp;b"])
    return chance.choice(
        [
            text[:place],
            text.replace(tag, "", 1),
            text.replace(tag, tag + tag, 1),
            text.replace(tag, other, 1),
            text.replace(chance.choice(numbers), nonsense, 1),
            text.replace(value, f'"{nonsense}"', 1),
            text.replace(value, chance.choice(values), 1),
            text.replace(word, word[::-1], 1),
            text[:place] + chance.choice('<>"&\0é\x07:[]{}') + text[place + 1 :],
            text[:place] + text[chance.randrange(place, len(text)) :],
        ]
    )


def outcome(folder, seed):
    """What becomes of a spoiled model: "read", or the line that refuses it."""
    chance = random.Random(seed)
    name, text, loops = ("bar.xml", BAR, None) if seed % 2 else ("door.urdf", DOOR, LOOPS)
    if loops and chance.random() < 0.5:
        loops = spoiled(loops, chance)
    else:
        text = spoiled(text, chance)
    file = folder / name
    file.write_text(text, encoding="utf8")
    if loops is not None:
        file.with_suffix(".yaml").write_text(loops, encoding="utf8")
    return read(file, seed)


def read(file, seed):
    try:
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            tree = Tree(describe(file, closures_of(file, None)))
            tree.closed()
            mechanism_of(tree.description)
    except redundax.RedundaxError as error:  # any other error is a crash
        assert str(error) and "\n" not in str(error), (seed, error)
        return str(error)
    return "read"


def of_assemblies(kind):
    """What makes a spoiled file of a format, by a seed."""
    texts = {
        "asmt": (test_asmt.four_bar(), test_asmt.crank((0.0, 0.3)), test_asmt.nut()),
        "sdf": (test_sdf.parallelogram(), test_sdf.parallelogram("universal", CROSS)),
        "usda": (usd.parallelogram(), usd.parallelogram("PhysicsJoint", ("rotX", "rotY"), 0.01), SHAPES),
    }[kind]

    def spoil(folder, seed):
        chance = random.Random(seed)
        file = folder / f"machine.{kind}"
        file.write_text(spoiled(chance.choice(texts), chance), encoding="utf8")
        return read(file, seed)

    return spoil


def check(folder, seeds, capfd, monkeypatch, outcome=outcome):
    monkeypatch.chdir(folder)
    outcomes = [outcome(folder, seed) for seed in seeds]
    assert "read" in outcomes and len(set(outcomes)) > len(seeds) / 20
    assert capfd.readouterr() == ("", "")
    assert not list(folder.glob("*.TXT"))  # no log of MuJoCo's


def test_spoiled_files_are_read_or_refused_in_a_line(tmp_path, capfd, monkeypatch):
    check(tmp_path, range(60), capfd, monkeypatch)


@pytest.mark.slow
def test_many_spoiled_files_are_read_or_refused_in_a_line(tmp_path, capfd, monkeypatch):
    check(tmp_path, range(60, 4000), capfd, monkeypatch)


@pytest.mark.parametrize("kind", ["asmt", "sdf", pytest.param("usda", marks=NEEDS_USD)])
def test_spoiled_assemblies_are_read_or_refused_in_a_line(tmp_path, capfd, monkeypatch, kind):
    check(tmp_path, range(60), capfd, monkeypatch, of_assemblies(kind))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["asmt", "sdf", pytest.param("usda", marks=NEEDS_USD)])
def test_many_spoiled_assemblies_are_read_or_refused_in_a_line(tmp_path, capfd, monkeypatch, kind):
    check(tmp_path, range(60, 3000), capfd, monkeypatch, of_assemblies(kind))


@NEEDS_USD
def test_spoiled_packages_are_read_or_refused_in_a_line(tmp_path, capfd):
    """A package of USD that is cut off, or of which a byte is another."""
    Sdf, UsdUtils = pytest.importorskip("pxr.Sdf"), pytest.importorskip("pxr.UsdUtils")
    (tmp_path / "machine.usda").write_text(usd.parallelogram())
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "machine.usda")), str(tmp_path / "whole.usdz"))
    whole, chance, outcomes = (tmp_path / "whole.usdz").read_bytes(), random.Random(0), []
    for seed in range(40):
        place, file = chance.randrange(len(whole)), tmp_path / f"{seed}.usdz"
        rest = b"" if seed % 2 else bytes([chance.randrange(256)]) + whole[place + 1 :]
        file.write_bytes(whole[:place] + rest)
        outcomes.append(read(file, seed))
    assert "read" in outcomes and len(set(outcomes)) > 2
    assert capfd.readouterr() == ("", "")
