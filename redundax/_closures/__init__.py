"""Closures: the k equations that choose one multiplier vector, and where they come from."""
