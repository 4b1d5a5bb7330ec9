"""The reference of the command line is what the commands say, and they say what is promised."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from fluentboard import __version__

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def writer() -> ModuleType:
    spec = spec_from_file_location("write_cli_reference", DOCS / "write_cli_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def texts(writer: ModuleType) -> dict[str, str]:
    return dict(writer.help_texts())


def run(*arguments: str, script: str = "") -> subprocess.CompletedProcess[str]:
    start = ("-c", script) if script else ("-m", "fluentboard")
    command = [sys.executable, *start, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_reference_is_what_the_commands_say(writer: ModuleType, texts: dict[str, str]) -> None:
    written = (DOCS / "reference" / "cli.md").read_text(encoding="utf-8")
    assert written == writer.page(texts), "run docs/write_cli_reference.py"


def test_every_command_shows_examples(texts: dict[str, str]) -> None:
    for command, text in texts.items():
        is_group = not command or any(other.startswith(f"{command} ") for other in texts)
        assert ("Examples:" in text) != is_group, command


@pytest.mark.parametrize(
    ("command", "flags"),
    [
        ("serve", "--host --port --data --ontology --durability --config --print-config"),
        ("import", "--board --format"),
        ("export", "--board --format --output --at"),
        ("query", "--board --format"),
        ("watch", "--board"),
        ("work mapping", "--board --frames --gravity --frame-out --plot --seed"),
        ("demo", "--frames --gravity --keep --output"),
    ],
)
def test_flags_that_scripts_rely_on_are_there(
    texts: dict[str, str], command: str, flags: str
) -> None:
    assert [flag for flag in flags.split() if f"{flag} " not in texts[command]] == []


def test_version_is_shown() -> None:
    assert run("--version").stdout == f"fluentboard {__version__}\n"


def test_wrong_usage_is_exit_code_2() -> None:
    assert run("query").returncode == 2
    assert run("import", "fluents.txt").returncode == 2


def test_error_is_one_line_and_exit_code_1() -> None:
    shown = run("query", "ASK {}", "--board", "nowhere")
    assert shown.returncode == 1
    assert shown.stdout == ""
    assert shown.stderr == (
        "invalid-input: board address 'nowhere' is not a URL; "
        "give one such as http://127.0.0.1:8080\n"
    )


def test_help_loads_no_framework() -> None:
    script = (
        "import sys\n"
        "from fluentboard.cli import create_app\n"
        "create_app()\n"
        "heavy = {'fastapi', 'uvicorn', 'rdflib', 'pyoxigraph', 'numpy', 'cv2', 'httpx'}\n"
        "print(*sorted(heavy & sys.modules.keys()))"
    )
    assert run(script=script).stdout == "\n"


def test_missing_extra_is_named() -> None:
    script = (
        "import sys\n"
        "sys.modules['cv2'] = None\n"
        "from fluentboard.cli import main\n"
        "sys.argv[0] = 'fluentboard'\n"
        "main()"
    )
    shown = run("work", "mapping", "--frames", "x", script=script)
    assert shown.returncode == 1
    assert shown.stderr == (
        "missing-extra: this command needs the extra 'mapping' (cv2 is missing); install it with: "
        "pip install 'fluentboard[mapping]'\n"
    )


def test_settings_can_be_printed() -> None:
    shown = run("serve", "--print-config", "--port", "9000", "--data", "kitchen")
    assert "  port: 9000  #" in shown.stdout
    assert "  data: kitchen  #" in shown.stdout
