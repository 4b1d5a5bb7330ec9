"""Perception modules: worker processes that read sensor frames and write fluents."""
