"""Semantic mapping (chapter 3): planes, furniture hypotheses, furniture fluents."""
