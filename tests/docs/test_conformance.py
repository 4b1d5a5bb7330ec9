"""The page on conformance says what the suites and the tests say."""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

CHECKOUT = Path(__file__).parents[2]
PAGE = (CHECKOUT / "docs" / "reference" / "conformance.md").read_text(encoding="utf-8")
W3C = CHECKOUT / "tests" / "e2e" / "w3c"


def loaded(file: str) -> ModuleType:
    name = f"conformance_{file}"
    spec = spec_from_file_location(name, W3C / f"{file}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_failures_are_those_that_are_expected_with_their_reasons() -> None:
    expected: dict[str, str] = loaded("test_w3c_suites").EXPECTED_FAILURES
    rows = dict(re.findall(r"^\| `([\w-]+/[\w-]+)` \| (.*) \|$", PAGE, re.MULTILINE))
    assert rows == expected


def test_cases_are_counted_as_the_manifests_list_them() -> None:
    cases = loaded("conftest").CASES
    if not cases:
        pytest.skip("no suite; set FLUENTBOARD_SHARED_DATA")
    failing = Counter(
        name.partition("/")[0] for name in loaded("test_w3c_suites").EXPECTED_FAILURES
    )
    counts = Counter(case.folder for case in cases)
    rows = re.findall(r"^\| ([\w-]+) \| (\d+) \| (\d+) \|$", PAGE, re.MULTILINE)
    told = {folder: (int(count), int(failures)) for folder, count, failures in rows}
    assert told == {folder: (count, failing[folder]) for folder, count in counts.items()}


def test_every_test_that_is_named_exists() -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", PAGE)
    assert named
    for file, function in named:
        tree = ast.parse((CHECKOUT / file).read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert not function or function in functions, f"{file}::{function}"
