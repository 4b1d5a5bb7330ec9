"""Python clients of the board, synchronous and asynchronous."""
