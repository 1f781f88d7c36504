"""Bodies as rounded bars or rounded hulls

{ x : |x - y| <= w for some y in the convex hull of the joint points and the centre of mass }
"""

import numpy as np

from ._pen import Pen, circle, hull
from ._scene import Scene
from ._stands import rail_ends
from ._style import BAR, BODY_Z, PIN, PIN_Z, body_colour, dark


def draw_bodies(pen: Pen, scene: Scene) -> list[np.ndarray]:
    """Draw all bodies of the plane and return their outlines, each (corners, 2)."""
    guides, points = [joint for joint in scene.joints if joint.slides], [scene.flat(span) for span in scene.spans]
    for joint in guides:
        if joint.j < scene.ground:
            points[joint.j] = np.concatenate(
                [points[joint.j], scene.flat(np.array(rail_ends(scene, joint, pen.point)))]
            )
    spans, sliders = list(map(hull, points)), {joint.i for joint in guides}
    outlines = []
    for body, (span, alike) in enumerate(zip(spans, _alike(spans, pen.point), strict=True)):
        # Bodies that cover each other lie like plates on a pin: each later one is narrower.
        above = sum(other > body for other in alike)
        width = (BAR if len(span) > 1 or body in sliders else 1.7 * BAR) + 3.0 * above
        outline = hull((span[:, None] + width * pen.point * circle(48)).reshape(-1, 2))
        colour, z = body_colour(body, scene.ground), BODY_Z + 0.6 * body / scene.ground
        if above < len(alike):
            pen.polygon(outline, "white", "none", z)
        pen.polygon(outline, (colour, 0.4), dark(colour), z, gid=f"body {scene.names[body]}")
        outlines.append(outline)
    return outlines


def centres_of_mass(pen: Pen, scene: Scene) -> None:
    """Symbols of centres of mass where no joint is."""
    angle, radius = np.linspace(0.0, np.pi / 2, 12), 2.8
    wedge = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    for body, centre in enumerate(scene.flat(scene.centres)):
        if np.any(np.hypot(*(scene.spots - centre).T) < (PIN + 5.0) * pen.point):
            continue
        colour = dark(body_colour(body, scene.ground))
        pen.circle(centre, radius, edge=colour, z=PIN_Z, linewidth=0.8)
        for side in (1.0, -1.0):
            pen.polygon(centre + side * radius * pen.point * wedge, colour, "none", PIN_Z)


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
