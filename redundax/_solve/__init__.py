"""Accelerations, multipliers and friction at a state: one solution, and all of them."""
