"""What a change of units changes: systems in other units, and the theory of Section 3 of the paper."""
