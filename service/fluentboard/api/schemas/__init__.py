"""Schemas: the JSON of bodies and replies, for the OpenAPI document and for clients.

They document. What a body means is decided by `fluentboard.model.json_format`, whose errors say
what to do; the tests hold the two together.
"""
