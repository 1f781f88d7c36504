"""The pictures of README.md: python docs/picture.py writes press.png, from its own code, and door.png to docs/pages."""

import re
from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np

import redundax as rx

jax.config.update("jax_enable_x64", True)
HERE = Path(__file__).parent
GUIDES = ["L force x on ram", "R force x on ram"]


def main() -> None:
    """Draw both."""
    draw_press()
    draw_door()


def draw_press() -> None:
    """Draw the press with the loads of the minimum norm, and beside it the bands of its guides."""
    scene: dict = {}
    exec(re.findall(r"```python\n(.*?)```", (HERE.parent / "README.md").read_text(), re.S)[0], scene)
    press, state = scene["press"], scene["state"]
    norm, elastic = rx.solve(press, state), rx.solve(press, state, closure=scene["joints"])
    bands = rx.band(press, state, GUIDES, scene["fit"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), width_ratios=(1, 1.15), layout="constrained")
    rx.plot.draw(press, state, axes=left, multipliers=norm.multipliers)
    left.set_title("One answer of a rigid-body model", fontsize=10)
    for row, (low, high) in enumerate(zip(bands.lower, bands.upper, strict=True)):
        right.barh(row, high - low, left=low, height=0.35, color="#9ecae1")
        right.text((low + high) / 2, row + 0.26, f"{low:.0f} to {high:.0f} N", ha="center", fontsize=10)
    rows = range(len(GUIDES))
    right.plot([norm[name] for name in GUIDES], rows, "o", color="#D55E00", label="that answer")
    right.plot([elastic[name] for name in GUIDES], rows, "|", ms=16, color="black", label="with stiffness, perfect fit")
    right.set_yticks(list(rows), ["guide L", "guide R"])
    right.set_ylim(-0.6, 1.7)
    right.set_xlim(1.15 * bands.lower.min(), 1.15 * bands.upper.max())
    right.set_xlabel("side force on the ram, N")
    right.set_title("What the guides may carry, fitted to 10 µm", fontsize=10)
    right.legend(loc="upper right", fontsize=9)
    figure.savefig(HERE / "pages" / "press.png", dpi=110)


def draw_door() -> None:
    """Draw a door of 40 kg whose hinges give way by 2 µm/N along their pins, and what of its weight they may carry."""
    door = rx.mechanisms.door(mass=40.0, lean=0.0)
    state = rx.assemble(door, positions={"hinge 1.angle": 0.4})
    names = ["hinge 1", "hinge 2", "hinge 3"]
    hinges = rx.ElasticJoints(door, {name: (2e-6, 1e-3) for name in names})
    fit = rx.MisfitBox(hinges, {f"{name}.axial": (-5e-4, 5e-4) for name in names})
    bands = rx.band(door, state, [f"{name} force z on door" for name in names], fit)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), width_ratios=(1, 1.15), layout="constrained")
    leaf = np.array([(x, y, z) for x in (0.0, 1.0) for y in (-0.02, 0.02) for z in (0.0, 2.0)])
    left.set_title("A door of 40 kg on three hinges", fontsize=10)
    rx.plot.draw(door, state, axes=left, report=rx.analyze(door, state), shapes={"door": leaf}, view=(15, -50))
    for row, (low, high) in enumerate(zip(bands.lower, bands.upper, strict=True)):
        right.barh(row, high - low, left=low, height=0.35, color="#9ecae1")
        right.text((low + high) / 2, row + 0.26, f"{low:.0f} to {high:.0f} N", ha="center", fontsize=10)
    right.axvline(40.0 * 9.81, color="black", lw=1)
    right.text(40.0 * 9.81 - 8, -0.55, "the whole weight", ha="right", fontsize=9)
    right.set_yticks(range(len(names)), names)
    right.set(xlabel="upward force on the door, N", xlim=(-300, 560), ylim=(-0.7, 2.6))
    right.set_title("What each hinge may carry of it, hung to 0.5 mm", fontsize=10)
    figure.savefig(HERE / "pages" / "door.png", dpi=110)


if __name__ == "__main__":
    main()
