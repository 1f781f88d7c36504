"""Bodies, joints and loads in space."""
