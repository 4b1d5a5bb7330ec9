"""HTTP and WebSocket around the board."""
