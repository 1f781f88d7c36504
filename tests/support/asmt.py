"""Files of ASMT, written anew: an assembly of parts with markers, joints, motions and a stored run"""

import numpy as np


def _row(values):
    return "\t".join(repr(float(value)) for value in values) + "\t"


def _lines(level, *texts):
    return [f"{'	' * level}{text}" for text in texts]


def _frame(level, position, axes=None):
    axes = np.eye(3) if axes is None else np.asarray(axes)
    return [
        *_lines(level, "Position3D"),
        *_lines(level + 1, _row(position)),
        *_lines(level, "RotationMatrix"),
        *_lines(level + 1, *map(_row, axes)),
    ]


def _markers(level, markers):
    found = _lines(level, "RefPoints")
    for name, place in markers.items():
        position, axes = place if isinstance(place[0], tuple) else (place, None)
        found += [*_lines(level + 1, "RefPoint"), *_frame(level + 2, (0, 0, 0)), *_lines(level + 2, "Markers")]
        found += [*_lines(level + 3, "Marker"), *_lines(level + 4, "Name"), *_lines(level + 5, name)]
        found += _frame(level + 4, position, axes)
    return [*found, *_lines(level, "RefCurves", "RefSurfaces")]


def part(name, position, axes, mass, centre, moments, markers):
    """A part at a position, with markers by name: points, or points and axes, in its frame."""
    return [
        *_lines(2, "Part"),
        *_lines(3, "Name"),
        *_lines(4, name),
        *_frame(3, position, axes),
        *_lines(3, "Velocity3D"),
        *_lines(4, _row((0, 0, 0))),
        *_lines(3, "Omega3D"),
        *_lines(4, _row((0, 0, 0))),
        *_lines(3, "FeatureOrder", "PrincipalMassMarker"),
        *_lines(4, "Name"),
        *_lines(5, "MassMarker"),
        *_frame(4, centre),
        *_lines(4, "Mass"),
        *_lines(5, repr(float(mass))),
        *_lines(4, "MomentOfInertias"),
        *_lines(5, _row(moments)),
        *_lines(4, "Density"),
        *_lines(5, "1.0"),
        *_markers(3, markers),
    ]


def joint(kind, name, i, j, **values):
    """A joint between markers, by their paths in the assembly."""
    found = [*_lines(3, kind), *_lines(4, "Name"), *_lines(5, name)]
    for word, path in (("MarkerI", i), ("MarkerJ", j)):
        found += [*_lines(4, word), *_lines(5, f"/rig/{path}")]
    for word, value in values.items():
        found += [*_lines(4, word), *_lines(5, repr(value))]
    return found


def motion(kind, name, of, word, formula):
    """A motion of a joint."""
    found = [*_lines(3, kind), *_lines(4, "Name"), *_lines(5, name), *_lines(4, "MotionJoint")]
    return [*found, *_lines(5, f"/rig/{of}"), *_lines(4, word), *_lines(5, formula)]


def _limit(number, kind, of, value, sign):
    """A limit of a joint, "=>" from below or "=<" from above."""
    words = {"Name": f"limit {number}", "MotionJoint": f"/rig/{of}", "Limit": value, "Type": sign}
    return [*_lines(3, kind), *(line for word, text in words.items() for line in [*_lines(4, word), *_lines(5, text)])]


def assembly(ground, parts, joints, motions=(), gravity=(0.0, 0.0, 0.0), rows=(), limits=()):
    """The whole file: markers of the ground, parts, joints, motions, and the rows of a stored run."""
    return "\n".join(
        [
            "OndselSolver",
            "Assembly",
            *_lines(1, "Notes"),
            *_lines(2, "(Text string: '' runs: #())"),
            *_lines(1, "Name"),
            *_lines(2, "rig"),
            *_frame(1, (0, 0, 0)),
            *_lines(1, "Velocity3D"),
            *_lines(2, _row((0, 0, 0))),
            *_lines(1, "Omega3D"),
            *_lines(2, _row((0, 0, 0))),
            *_markers(1, ground),
            *_lines(1, "Parts"),
            *(line for each in parts for line in each),
            *_lines(1, "KinematicIJs", "ConstraintSets"),
            *_lines(2, "Joints"),
            *(line for each in joints for line in each),
            *_lines(2, "Motions"),
            *(line for each in motions for line in each),
            *(_lines(2, "Limits") if limits else []),
            *(line for k, each in enumerate(limits) for line in _limit(k, *each)),
            *_lines(2, "GeneralConstraintSets"),
            *_lines(1, "ForceTorques", "ConstantGravity"),
            *_lines(2, _row(gravity)),
            *rows,
            "",
        ]
    )


def run(times, series):
    """Rows of a stored run; the first number of each is of no time."""
    found = ["TimeSeries", "Number\tInput\t" + "\t".join(map(str, range(1, len(times) + 1)))]
    found.append("Time\tInput\t" + _row(times))
    for head, words, values in series:
        found.append(head)
        found += [f"{word}\t0\t{_row(row)}" for word, row in zip(words.split(), np.asarray(values).T, strict=True)]
    return found
