"""How far an output reaches over a family."""
