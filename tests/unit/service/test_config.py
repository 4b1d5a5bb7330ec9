from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from fluentboard.config import (
    Settings,
    environment_variable,
    load_settings,
    setting_sections,
    settings_yaml,
)
from fluentboard.errors import InvalidConfiguration

TOKEN = {"name": "robot", "role": "write", "token": "a secret of the robot"}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "board.yaml"
    path.write_text("server:\n  port: 1001\n  host: 10.0.0.1\nlimits: {batch_max: 7}\n")
    return path


def test_the_defaults_are_complete() -> None:
    settings = load_settings()
    assert settings == Settings()
    assert settings.is_loopback


def test_a_file_overrides_defaults(file: Path) -> None:
    settings = load_settings(file)
    assert (settings.server.port, settings.limits.batch_max) == (1001, 7)
    assert settings.limits.page_max == Settings().limits.page_max


def test_variables_override_the_file(file: Path) -> None:
    settings = load_settings(file, {"FLUENTBOARD_SERVER_PORT": "1002"})
    assert (settings.server.port, settings.server.host) == (1002, "10.0.0.1")


def test_flags_override_variables(file: Path) -> None:
    environment = {"FLUENTBOARD_SERVER_PORT": "1002"}
    assert load_settings(file, environment, {"server.port": 1003}).server.port == 1003


def test_a_flag_that_was_not_given_overrides_nothing(file: Path) -> None:
    assert load_settings(file, {}, {"server.port": None}).server.port == 1001


@pytest.mark.parametrize(
    ("name", "text", "section", "key", "value"),
    [
        ("FLUENTBOARD_STORAGE_DATA", "", "storage", "data", None),
        ("FLUENTBOARD_STORAGE_DATA", "42", "storage", "data", Path("42")),
        ("FLUENTBOARD_SERVER_ACCESS_LOG", "true", "server", "access_log", True),
        ("FLUENTBOARD_LIMITS_QUERY_TIMEOUT_S", "1.5", "limits", "query_timeout_s", 1.5),
        ("FLUENTBOARD_STORAGE_ONTOLOGIES", "a.ttl", "storage", "ontologies", (Path("a.ttl"),)),
        (
            "FLUENTBOARD_SECURITY_CORS_ORIGINS",
            "[https://a.example, https://b.example]",
            "security",
            "cors_origins",
            ("https://a.example", "https://b.example"),
        ),
    ],
)
def test_variables_are_read_by_the_type_of_their_setting(
    name: str, text: str, section: str, key: str, value: object
) -> None:
    settings = load_settings(environment={name: text})
    assert getattr(getattr(settings, section), key) == value


def test_variables_of_clients_are_left_alone() -> None:
    assert load_settings(environment={"FLUENTBOARD_TOKEN": "x", "FLUENTBOARD_BOARD": "y"})


@pytest.mark.parametrize(
    ("environment", "flags", "message"),
    [
        ({"FLUENTBOARD_SERVER_PROT": "1"}, {}, "no key 'prot'"),
        ({"FLUENTBOARD_SERVERS_PORT": "1"}, {}, "did you mean 'server'"),
        ({"FLUENTBOARD_SERVER_PORT": "70000"}, {}, "FLUENTBOARD_SERVER_PORT.*70000"),
        ({"FLUENTBOARD_SERVER_PORT": "[1"}, {}, "is not YAML"),
        ({}, {"server.prt": 1}, "did you mean 'port'"),
        ({}, {"limits.batch_max": 0}, "greater than or equal to 1"),
        ({}, {"limits.query_timeout_s": float("nan")}, "limits.query_timeout_s"),
        ({}, {"storage.durability": "hope"}, "'disk' or 'process'"),
        ({}, {"server.root_path": "board/"}, "starts with a slash"),
        ({}, {"security.tokens": [TOKEN, TOKEN]}, "same name"),
    ],
)
def test_a_wrong_setting_is_named(
    environment: dict[str, str], flags: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidConfiguration, match=message):
        load_settings(None, environment, flags)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("server: [1, 2", "is not YAML"),
        ("servers: {}", "unknown section 'servers'; did you mean 'server'"),
        ("server: 3", "not a mapping"),
        ("- a", "not a mapping"),
        ("server: {port: 80, poort: 81}", "server.poort"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "board.yaml"
    path.write_text(text)
    with pytest.raises(InvalidConfiguration, match=message):
        load_settings(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidConfiguration, match="cannot read"):
        load_settings(tmp_path / "nowhere.yaml")


def test_a_short_secret_is_refused_and_not_repeated() -> None:
    with pytest.raises(InvalidConfiguration) as refusal:
        load_settings(flags={"security.tokens": [{**TOKEN, "token": "hunter2"}]})
    assert "hunter2" not in str(refusal.value)


def test_printed_settings_are_settings() -> None:
    settings = load_settings(flags={"server.port": 0, "storage.data": Path("/tmp/board")})
    printed = yaml.safe_load(settings_yaml(settings))
    assert Settings.model_validate(printed) == settings


def test_printed_settings_hide_secrets() -> None:
    settings = load_settings(flags={"security.tokens": [TOKEN]})
    assert "robot" in settings_yaml(settings)
    assert TOKEN["token"] not in settings_yaml(settings)


def test_every_setting_has_a_description_and_a_variable() -> None:
    for section, model in setting_sections():
        for key, field in model.model_fields.items():
            assert field.description, f"{section}.{key}"
            assert environment_variable(section, key) == f"FLUENTBOARD_{section}_{key}".upper()
