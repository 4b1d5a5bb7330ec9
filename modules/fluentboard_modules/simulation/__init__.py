"""Scenes with known truth, a simulated RGB-D sensor and robots."""
