"""The family of solutions: every frictional solution along the self-stress, and bands of outputs under bounds."""
