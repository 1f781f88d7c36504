"""Analysis at a state: rank, self-stress, verdicts and releases."""
