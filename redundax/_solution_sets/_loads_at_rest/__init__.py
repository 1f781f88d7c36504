"""Loads of a mechanism at rest: all that equilibrium, friction within its limits and the bounds on preload allow."""
