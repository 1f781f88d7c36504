"""Joints in space, by what they lock."""
