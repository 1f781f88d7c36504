"""Models from files: read, made into bodies and joints, and closed."""
