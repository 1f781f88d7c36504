"""Mechanisms made of bodies, joints and loads."""
