"""What a program has stored of a run of its model: positions of bodies and reactions of joints over time"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class BodySeries:
    """Of a body over time: where its frame is, (times, 3), its axes, (times, 3, 3), and velocity and angular velocity,
    (times, 3); global, m, m/s, rad/s. Velocities are None where they are not stored.

    ??? example

        ```python
        import numpy as np

        rx.types.BodySeries(np.zeros((1, 3)), np.eye(3)[None])
        ```
    """

    position: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class ReactionSeries:
    """Of a joint over time: force, N, and moment, N m, on the body `on`, about `point`, both (times, 3), in global
    axes. `point` is fixed to that body, in its frame, m; on "ground" it is global.

    ??? example

        ```python
        import numpy as np

        rx.types.ReactionSeries("ground", np.zeros(3), np.array([[0.0, 0.0, 9.81]]), np.zeros((1, 3)))
        ```
    """

    on: str
    point: np.ndarray
    force: np.ndarray
    moment: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Series:
    """A stored run: `times`, s, (times,); `bodies` and `reactions` of joints and drives, by their names.

    ??? example

        ```python
        import numpy as np

        at_rest = rx.types.ReactionSeries("ground", np.zeros(3), np.array([[0.0, 0.0, 9.81]]), np.zeros((1, 3)))
        rx.types.Series(np.zeros(1), {}, {"pin": at_rest})
        ```
    """

    times: np.ndarray
    bodies: dict[str, BodySeries]
    reactions: dict[str, ReactionSeries]
