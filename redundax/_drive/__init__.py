"""Machines whose drives follow laws of time: positions along them, and which forces the drives must give."""
