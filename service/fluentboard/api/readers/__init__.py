"""Readers: processes that evaluate queries and can be killed."""
