"""What the equations are asked of: coordinates, rows, state, friction, units, and how a result is told."""
