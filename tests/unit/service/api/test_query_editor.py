"""The page on which people ask queries."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256

import httpx

TOKEN = {"name": "robot", "role": "write", "token": "robot-secret-000001"}


def test_the_editor_runs_its_own_script_and_no_other(api: httpx.Client) -> None:
    reply = api.get("/editor")
    assert reply.headers["content-type"] == "text/html; charset=utf-8"
    (script,) = re.findall(r"<script>(.*?)</script>", reply.text, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    policy = reply.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'")
    assert f"script-src 'sha256-{digest}'" in policy
    assert "http" not in reply.text.replace("https://w3id.org", "")


def test_the_editor_is_there_without_a_token(make_api: Callable[..., httpx.Client]) -> None:
    assert make_api(security__tokens=[TOKEN]).get("/editor").status_code == 200


def test_the_index_leads_to_the_editor(api: httpx.Client) -> None:
    assert "/editor'" in api.get("/", headers={"Accept": "text/html"}).text


def test_the_editor_uses_routes_and_parameters_that_there_are(api: httpx.Client) -> None:
    page = api.get("/editor").text
    assert set(re.findall(r'root \+ "(/\w+)"', page)) == {"/sparql", "/classes"}
    (query,) = re.findall(r"<textarea[^>]*>(.*?)</textarea>", page, re.DOTALL)
    form = {"query": query, "at": "now", "certainly": "true", "asof": "1"}
    assert api.post("/sparql", data=form).status_code == 200
