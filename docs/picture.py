"""The picture at the head of README.md, from its own code: python docs/picture.py writes docs/pages/press.png."""

import re
from pathlib import Path

import jax
import matplotlib.pyplot as plt

import redundax as rx

jax.config.update("jax_enable_x64", True)
HERE = Path(__file__).parent
GUIDES = ["L force x on ram", "R force x on ram"]


def main() -> None:
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


if __name__ == "__main__":
    main()
