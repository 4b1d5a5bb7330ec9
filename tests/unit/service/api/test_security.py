from __future__ import annotations

from typing import Any

import pytest

from fluentboard.api.security import ANYONE, Guard, check_exposure
from fluentboard.config import Role, load_settings
from fluentboard.errors import InvalidConfiguration, NotAllowed, NotAuthenticated

READER = {"name": "viewer", "role": "read", "token": "reader-secret-0001"}
WRITER = {"name": "mapping", "role": "write", "token": "writer-secret-0001"}


def guard(**settings: Any) -> Guard:
    return Guard(load_settings(flags={k.replace("__", "."): v for k, v in settings.items()}))


def with_token(secret: str) -> dict[bytes, bytes]:
    return {b"authorization": f"Bearer {secret}".encode()}


def test_an_open_board_admits_anyone() -> None:
    assert guard().admit({b"host": b"127.0.0.1:8080"}, "admin", changes=True) == ANYONE


def test_a_token_says_who_calls() -> None:
    admitted = guard(security__tokens=[WRITER]).admit(
        with_token("writer-secret-0001"), "write", changes=True
    )
    assert (admitted.name, admitted.role) == ("mapping", "write")


@pytest.mark.parametrize(
    "headers",
    [
        {},
        with_token("nobody's secret"),
        with_token(""),
        {b"authorization": b"Basic d3JpdGVyLXNlY3JldC0wMDAx"},
        {b"authorization": b"Bearer"},
    ],
)
def test_without_a_valid_token_a_closed_board_admits_nobody(headers: dict[bytes, bytes]) -> None:
    with pytest.raises(NotAuthenticated):
        guard(security__tokens=[WRITER]).admit(headers, "read", changes=False)


@pytest.mark.parametrize(("secret", "role"), [(READER, "write"), (WRITER, "admin")])
def test_a_role_permits_no_more_than_it_says(secret: dict[str, str], role: Role) -> None:
    with pytest.raises(NotAllowed, match=f"this needs {role}"):
        guard(security__tokens=[READER, WRITER]).admit(
            with_token(secret["token"]), role, changes=True
        )


def test_a_role_includes_the_ones_before_it() -> None:
    admitted = guard(security__tokens=[WRITER]).admit(
        with_token("writer-secret-0001"), "read", changes=False
    )
    assert admitted.name == "mapping"


@pytest.mark.parametrize(
    "host", ["localhost", "127.0.0.1:8080", "[::1]:8080", "192.168.1.7", "board", "a.localhost:1"]
)
def test_an_open_board_answers_to_names_of_this_machine(host: str) -> None:
    guard().admit({b"host": host.encode()}, "read", changes=False)


def test_an_open_board_does_not_answer_to_a_foreign_host_name() -> None:
    with pytest.raises(NotAllowed, match=r"evil\.example"):
        guard().admit({b"host": b"evil.example:8080"}, "read", changes=False)


def test_a_host_name_can_be_allowed() -> None:
    allowing = guard(security__allowed_hosts=["robot.local"])
    allowing.admit({b"host": b"robot.local:8080"}, "read", changes=False)


def test_a_foreign_page_may_not_change_an_open_board() -> None:
    headers = {b"host": b"localhost:8080", b"origin": b"https://evil.example"}
    with pytest.raises(NotAllowed, match="may not change"):
        guard().admit(headers, "write", changes=True)


def test_a_page_of_the_board_itself_may() -> None:
    headers = {b"host": b"localhost:8080", b"origin": b"http://localhost:8080"}
    guard().admit(headers, "write", changes=True)


def test_a_page_of_an_allowed_origin_may() -> None:
    headers = {b"host": b"localhost:8080", b"origin": b"https://lab.example"}
    guard(security__cors_origins=["https://lab.example"]).admit(headers, "write", changes=True)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "robot.local"])
def test_an_open_board_does_not_listen_where_others_reach_it(host: str) -> None:
    with pytest.raises(InvalidConfiguration, match="without a token"):
        check_exposure(load_settings(flags={"server.host": host}))


@pytest.mark.parametrize(
    "settings",
    [
        {"server.host": "127.0.0.1"},
        {"server.host": "::1"},
        {"server.host": "localhost"},
        {"server.host": "0.0.0.0", "security.tokens": [WRITER]},
        {"server.host": "0.0.0.0", "security.allow_open": True},
    ],
)
def test_loopback_a_token_or_a_word_permit_to_listen(settings: dict[str, Any]) -> None:
    check_exposure(load_settings(flags=settings))
