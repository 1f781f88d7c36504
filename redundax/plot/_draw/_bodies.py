"""Bodies as rounded bars or rounded hulls

{ x : |x - y| <= w for some y in the convex hull of the joint points and the centre of mass }
"""

import numpy as np

from ._pen import OUTLINE, Pen, circle
from ._scene import Scene
from ._style import BAR, BLOCK, BODY_Z, PIN, body_colour, dark


def draw_bodies(pen: Pen, scene: Scene) -> list[np.ndarray]:
    """Draw all bodies and return their outlines, each (corners, 2)."""
    spans, sliders = _spans(pen, scene), {joint.i for joint in scene.joints if joint.axis is not None}
    symbols = np.array([spot for joint in scene.joints for spot in (joint.spot, joint.on_i)]).reshape(-1, 2)
    outlines = []
    for body, (span, alike) in enumerate(zip(spans, _alike(spans, pen.point), strict=True)):
        # Bodies that cover each other lie like plates on a pin: each later one is narrower.
        above = sum(other > body for other in alike)
        width = (BAR if len(span) > 1 or body in sliders else 1.7 * BAR) + 3.0 * above
        outline = hull((span[:, None] + width * pen.point * circle(48)).reshape(-1, 2))
        colour, z = body_colour(body, scene.ground), BODY_Z + 0.6 * body / scene.ground
        if above < len(alike):
            pen.polygon(outline, "white", "none", z)
        pen.polygon(outline, colour, dark(colour), z, opacity=0.4, gid=f"body {scene.names[body]}")
        pen.cover_path(outline, 3.0, OUTLINE)
        outlines.append(outline)
        if not np.any(np.hypot(*(symbols - scene.centres[body]).T) < (PIN + 5.0) * pen.point):
            _centre_of_mass(pen, scene.centres[body], dark(colour))
    return outlines


def _spans(pen: Pen, scene: Scene) -> list[np.ndarray]:
    """Corners of what each body spans: its points and the guides that it carries."""
    points = [[*scene.joint_points(body)] for body in range(scene.ground)]
    for joint in scene.joints:
        if joint.axis is not None and joint.j < scene.ground:
            reach = guide_reach(joint.length, pen.point) * joint.axis
            points[joint.j] += [joint.on_i - reach, joint.on_i + reach]
    return [hull(np.array(each)) for each in points]


def guide_reach(length: float | None, point: float) -> float:
    """Half the length of a guide as drawn, in data units; `length` is that of the slider."""
    return (block_length(length, point) / 2 + 17.0) * point


def block_length(length: float | None, point: float) -> float:
    """Length of a slider in points: its own where it has one, as long as that looks well."""
    return float(np.clip((length or 0.0) / point, BLOCK[0], 90.0))


def _centre_of_mass(pen: Pen, centre: np.ndarray, colour: str) -> None:
    radius = 2.8
    pen.circle(centre, radius, edge=colour, z=BODY_Z + 0.65, linewidth=0.8)
    for start in (0.0, np.pi):
        angle = start + np.linspace(0.0, np.pi / 2, 12)
        wedge = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angle), np.sin(angle)], axis=1)])
        pen.polygon(centre + radius * pen.point * wedge, colour, "none", BODY_Z + 0.7)
    pen.cover(centre, radius, OUTLINE)


def _alike(spans: list[np.ndarray], point: float) -> list[list[int]]:
    """For each of the spans, which others have as many corners, and one beside each of its own."""
    corners, near = np.concatenate(spans), 3.0 * point
    owner = np.repeat(np.arange(len(spans)), [len(span) for span in spans])

    def covers(span: np.ndarray, other: np.ndarray) -> bool:
        gaps = np.hypot(*(span[:, None] - other[None]).transpose(2, 0, 1))
        return len(span) == len(other) and bool(np.all(gaps.min(axis=1) < near))

    found = []
    for body, span in enumerate(spans):
        others = np.unique(owner[np.hypot(*(corners - span[0]).T) < near])
        found.append([int(k) for k in others if k != body and covers(span, spans[k])])
    return found


def hull(points: np.ndarray) -> np.ndarray:
    """Corners of the convex hull, counterclockwise (monotone chain)."""
    size = float(np.ptp(points, axis=0).max())
    unique = np.unique(np.round(points, 12 - int(np.floor(np.log10(size))) if size else 12), axis=0)
    if len(unique) < 3:
        return unique

    def chain(ordered: np.ndarray) -> list[np.ndarray]:
        corners: list[np.ndarray] = []
        for point in ordered:
            while len(corners) > 1:
                a, b = corners[-1] - corners[-2], point - corners[-2]
                if a[0] * b[1] - a[1] * b[0] > 1e-9 * size**2:
                    break
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return np.array(chain(unique) + chain(unique[::-1]))
