"""Whether joints at rest stay at rest."""
