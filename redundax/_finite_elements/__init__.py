"""Loads of bodies for programs of finite elements."""
