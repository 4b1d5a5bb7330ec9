"""Context-aware anchoring: stable names for the objects on tables (Chapter 4)."""
