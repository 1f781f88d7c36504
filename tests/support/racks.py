"""Rows of parallel cranks joined by couplers, every third pin twice over: what large scenes are made of."""

import redundax as rx

ROD = {"mass": 1.0, "inertia": 1 / 12}


def rods(kind: str, count: int) -> list[rx.Body]:
    """Rods of 1 m and 1 kg."""
    return [rx.Body(f"{kind}{k}", **ROD) for k in range(count)]


def parts(loops: int) -> tuple[list[rx.Body], list[tuple]]:
    """Cranks c0, c1, ... and couplers b0, b1, ...; and arguments of their pins, A0, ... in the ground, B0, C0, ... of
    couplers, and those twice over, with a dash."""
    pins = [(f"A{k}", f"c{k}", "ground", (-0.5, 0.0), (float(k), 0.0)) for k in range(loops + 1)]
    for k in range(loops):
        pins.append((f"B{k}", f"b{k}", f"c{k}", (-0.5, 0.0), (0.5, 0.0)))
        pins.append((f"C{k}", f"b{k}", f"c{k + 1}", (0.5, 0.0), (0.5, 0.0)))
    pins += [(f"{pin[0]}'", *pin[1:]) for pin in pins[::3]]
    return rods("c", loops + 1) + rods("b", loops), pins
