"""The demo: from an empty board to pictures of what was found, in one command."""
