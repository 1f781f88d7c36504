"""The family of all solutions: the self-stress and the branches of friction over it."""
