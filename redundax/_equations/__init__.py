"""The index-1 equations at a state: kinematics, scales, rank, factorisation and the evidence for it."""
