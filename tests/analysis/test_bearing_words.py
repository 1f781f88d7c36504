"""Releases in the words of bearings: of hand-made releases, and of a shaft whose thrust two bearings share."""

import pytest

import redundax as rx
from redundax._analysis._bearing_words import bearing_words
from redundax._analysis._release import Release

HINGE = ("radial_1", "radial_2", "axial", "bend_1", "bend_2")
CARDAN = ("radial_1", "radial_2", "axial", "twist")
ROWS = (*(f"{joint}.{row}" for joint in ("top", "mid bearing") for row in HINGE), "A.x", "A.y")
ROWS += tuple(f"u0.{row}" for row in CARDAN)


@pytest.mark.parametrize(
    ("freed", "words"),
    [
        (["mid bearing.axial"], "let mid bearing slide along its axis (floating bearing)"),
        (["top.bend_1", "top.bend_2"], "let top tilt (self-aligning bearing)"),
        (
            ["top.bend_2", "top.axial", "top.bend_1"],
            "let top slide along its axis and tilt (floating and self-aligning bearing)",
        ),
        (
            [f"top.{row}" for row in HINGE] + ["mid bearing.radial_1", "mid bearing.radial_2"],
            "leave top out; let mid bearing give way across its axis",
        ),
        (["u0.twist"], "let u0 turn about all axes, as a ball joint"),
        (["u0.axial"], "let u0 slide along its axis on its second body (floating bearing)"),
        ([f"u0.{row}" for row in CARDAN], "leave u0 out"),
        (["top.bend_1"], ""),
        (["top.axial", "mid bearing.radial_1"], ""),
        (["A.x"], ""),
    ],
)
def test_words_of_releases(freed, words):
    release = Release(tuple((row.rpartition(".")[0], {row: 1.0}) for row in freed), 0.5)
    assert bearing_words(release, ROWS) == words


def test_an_oblique_direction_is_no_bearing():
    """One direction of a pin in the plane, as of a parallelogram; one of two across an axis in space."""
    for rows in (("A.x", "A.y"), ("top.bend_1", "top.bend_2")):
        release = Release(((rows[0].rpartition(".")[0], dict.fromkeys(rows, 0.7)),), 0.5)
        assert bearing_words(release, ROWS) == ""


@pytest.mark.slow
def test_an_analysis_says_which_bearing_is_to_float():
    """A locating bearing and one that aligns itself but holds the thrust too."""
    shaft = rx.spatial.Body("shaft", 2.0, inertia=(0.1, 0.1, 0.01))
    axis = {"axis": (0.0, 0.0, 1.0)}
    joints = [
        rx.spatial.Revolute("hinge", shaft, "ground", point=(0, 0, 0), **axis),
        rx.spatial.PointOnPlane("thrust", shaft, "ground", point=(0, 0, 1), **axis),
    ]
    mechanism = rx.Mechanism([shaft], joints)
    page = " ".join(str(rx.analyze(mechanism, rx.assemble(mechanism, rates={"hinge.angle": 1.0}))).split())
    assert "In words of bearings, of the releases below: " in page and "slide along its axis (floating bearing)" in page
