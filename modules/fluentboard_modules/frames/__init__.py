"""Sensor frames and where they come from."""
