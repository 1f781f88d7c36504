"""Ready-made mechanisms in space."""
