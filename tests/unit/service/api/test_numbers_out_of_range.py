"""Numbers that no number of the board can be are refused, however many digits they have."""

from __future__ import annotations

import httpx
import pytest

from fluentboard.api.live_request import position_from_text, request_from_json
from fluentboard.errors import InvalidInput

MANY_DIGITS = "9" * 5_000  # more than Python reads
JUST_TOO_MANY = str(2**63)  # more than SQLite keeps


@pytest.mark.parametrize("digits", [MANY_DIGITS, JUST_TOO_MANY])
@pytest.mark.parametrize(
    "target",
    [
        "/fluents?limit={}",
        "/fluents?asof={}",
        "/frames/camera?after={}",
        "/audit?after={}",
        "/changes?since={}",
        "/sparql?query=ASK%7B%7D&asof={}",
    ],
)
def test_number_out_of_range_is_refused(api: httpx.Client, target: str, digits: str) -> None:
    reply = api.get(target.format(digits))
    assert (reply.status_code, reply.json()["code"]) == (422, "invalid-input")


def test_frame_of_a_number_out_of_range_is_refused(api: httpx.Client) -> None:
    assert api.get(f"/frames/camera/{MANY_DIGITS}").json()["code"] == "invalid-input"


@pytest.mark.parametrize("port", [MANY_DIGITS, "²"])
def test_odd_port_in_the_host_is_passed_over(api: httpx.Client, port: str) -> None:
    reply = api.get("/subscribe", headers=[(b"host", f"board:{port}".encode("latin-1"))])
    assert reply.json()["sparql11seprotocol"]["availableProtocols"]["ws"]["port"] == 80


@pytest.mark.parametrize("commit", [2**63, -1, True, 1.5])
def test_subscription_since_no_commit_is_refused(commit: object) -> None:
    with pytest.raises(InvalidInput, match="since"):
        request_from_json({"query": "ASK {}", "since": commit})
    with pytest.raises(InvalidInput, match="commit"):
        request_from_json({"query": "ASK {}", "replay": {"commit": commit}})


@pytest.mark.parametrize("text", [MANY_DIGITS, JUST_TOO_MANY, f"{JUST_TOO_MANY}:3", "-1"])
def test_position_that_cannot_be_kept_is_refused(text: str) -> None:
    with pytest.raises(InvalidInput, match="no position"):
        position_from_text(text)
