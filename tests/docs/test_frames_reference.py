"""docs/reference/frames.md and supervision.md say what the code does."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
import rdflib

from fluentboard_modules.frames.folders import LAYOUTS
from fluentboard_modules.frames.recorder import Layout
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.supervision.worker_fluents import ACTIVITY, STATUS
from fluentboard_ontology import PREFIXES, UPPER, read

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
FRAMES = (REFERENCE / "frames.md").read_text(encoding="utf-8")
SUPERVISION = (REFERENCE / "supervision.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def upper() -> rdflib.Graph:
    return rdflib.Graph().parse(data=read("upper"), format="turtle")


def test_every_layout_that_is_read_is_named() -> None:
    for layout in LAYOUTS:
        for word in layout.name.split("/"):
            assert word in FRAMES


def test_every_layout_that_is_written_is_named() -> None:
    for layout in get_args(Layout):
        assert re.search(rf"^\| .*`{layout}`.*\|$", FRAMES, re.MULTILINE), layout


@pytest.mark.parametrize(
    "text", ["sim:room", "http://host:8080/frames/head?after=3", "/no/such/drive.bag"]
)
def test_every_option_is_named(text: str) -> None:
    mark = "&" if "?" in text else "?"
    with pytest.raises(Exception, match="options are") as caught:
        open_source(f"{text}{mark}nonsense=1")
    listed = str(caught.value).partition("options are ")[2]
    for option in (word for word in listed.split(", ") if word not in ("", "none")):
        assert f"`{option}=" in FRAMES, option


def test_python_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    examples = re.findall(r"```python\n(.*?)```", FRAMES, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        exec(compile(example, "frames.md", "exec"), {})
    assert "(60, 80, 3)" in capsys.readouterr().out


def test_queries_of_the_page_parse_and_use_declared_terms(upper: rdflib.Graph) -> None:
    examples = re.findall(r"```sparql\n(.*?)```", SUPERVISION, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        list(upper.query(example, initNs=dict(PREFIXES)))
        for name in re.findall(r"upper:(\w+)", example):
            assert (rdflib.URIRef(UPPER + name), None, None) in upper, name


def test_every_property_of_workers_is_in_the_table(upper: rdflib.Graph) -> None:
    domain = rdflib.RDFS.domain
    for kind in (ACTIVITY, STATUS):
        for term in upper.subjects(domain, rdflib.URIRef(UPPER + kind)):
            name = str(term).rpartition("#")[2]
            assert re.search(rf"^\| .*`{name}`.*\|$", SUPERVISION, re.MULTILINE), name
