"""Colours of Okabe and Ito, which colour-blind readers tell apart; what differs in colour differs in shape too."""

INK = "#222222"
GROUND = "#555555"
APPLIED = "#222222"
LOAD = "#D55E00"  # vermillion, filled arrows
STRESS = "#0072B2"  # blue, open arrows
BODIES = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442")

# Sizes in points of print.
PIN = 4.2
BAR = 5.5  # half the width of a bar
TURN = 13.0  # radius of a circular arrow
FONT = 9.0  # of a caption in print

# From the paper up: what is higher hides what is lower.
GROUND_Z, BODY_Z, BLOCK_Z, ARROW_Z, PIN_Z, LABEL_Z = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0


def body_colour(index: int, ground: int) -> str:
    """Fill colour of a body; the ground is grey."""
    return "#DDDDDD" if index >= ground else BODIES[index % len(BODIES)]


def dark(colour: str, factor: float = 0.55) -> str:
    """A darker tone of a colour "#RRGGBB"."""
    parts = [round(int(colour[k : k + 2], 16) * factor) for k in (1, 3, 5)]
    return "#" + "".join(f"{part:02X}" for part in parts)


def quantity(value: float, unit: str) -> str:
    """A size with three digits and its unit, if that is known."""
    size = abs(value)
    if size and not 1e-3 <= size < 1e5:
        return f"{size:.2e} {unit}".rstrip()
    whole = f"{size:.3g}"
    return f"{whole if 'e' not in whole else f'{size:.0f}'} {unit}".rstrip()
