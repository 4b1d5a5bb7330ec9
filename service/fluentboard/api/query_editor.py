"""The query editor: one page without anybody else's scripts, for people who look at a board."""

from __future__ import annotations

import re
from base64 import b64encode
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files

from fluentboard.api.exchange import Call, Reply
from fluentboard.api.operations import Answer, Content, Operation

PATH = "/editor"

_SCRIPT = re.compile(rb"<script>(.*?)</script>", re.DOTALL)


def operations() -> list[Operation]:
    """The route, documented."""
    return [
        Operation(
            "GET",
            PATH,
            _page,
            "getEditor",
            "Ask queries in a browser",
            tag="operation",
            role=None,
            answers={200: Answer("A page.", {"text/html": Content({"type": "string"})})},
            is_strict=False,
        )
    ]


async def _page(call: Call) -> Reply:
    page, policy = _read()
    return Reply(page, b"text/html; charset=utf-8", 200, [(b"content-security-policy", policy)])


@lru_cache(maxsize=1)
def _read() -> tuple[bytes, bytes]:
    """The page, and what a browser may do on it: run its own script and ask its own board."""
    page = (files("fluentboard.api") / "query_editor.html").read_bytes()
    script = _SCRIPT.search(page)
    assert script is not None, "the page has one script"
    digest = b64encode(sha256(script[1]).digest()).decode()
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return page, policy.encode()
