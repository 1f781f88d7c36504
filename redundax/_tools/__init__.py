"""Small helpers that know nothing of mechanisms."""
