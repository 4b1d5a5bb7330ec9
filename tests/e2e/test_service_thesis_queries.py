"""The two queries of the thesis, word for word, over HTTP on a small restaurant."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from fluentboard_modules.demo.service_process import ServiceProcess

GOLDEN = Path(__file__).parents[1] / "golden"
FLOOR_AREAS = (GOLDEN / "query_2_3.rq").read_text(encoding="utf-8")
OBJECTS = (GOLDEN / "query_4_2_4.rq").read_text(encoding="utf-8")
FLUENT = "https://w3id.org/fluentboard/fluent/"

# Name, class, height of the bounding box; those on the floor are what the first query asks for.
AREAS = (
    ("manipulationAreaEastCounter1", "ManipulationArea", 0.0),
    ("premanipulationAreaEastCounter1", "PreManipulationArea", 0.0),
    ("placingAreaEastRightCounter1", "PlacingArea", 0.95),
    ("placingAreaWestTable1", "PlacingArea", 0.73),
)
OBJECTS_SEEN = (
    ("mug7", "Mug", True),
    ("coffee1", "Coffee", True),
    ("plate1", "Plate", True),
    ("spoon7", "Spoon", False),  # no bounding box yet
)
FURNITURE = (("table1", "Table"), ("counter1", "Counter"))


def boxed(name: str, class_name: str, height_m: float) -> Iterator[dict[str, Any]]:
    """A fluent with a bounding box, the box and its pose."""
    yield {
        "name": name,
        "class": class_name,
        "properties": [["hasBoundingBox", "BBox", f"{name}Box"]],
    }
    yield {
        "name": f"{name}Box",
        "class": "BBox",
        "properties": [
            ["hasPose", "Pose", f"{name}BoxPose"],
            ["hasXSize", "xsd:float", 0.5],
        ],
    }
    yield {
        "name": f"{name}BoxPose",
        "class": "Pose",
        "properties": [["hasX", "xsd:float", 5.59], ["hasZ", "xsd:float", height_m]],
    }


def restaurant() -> list[dict[str, Any]]:
    fluents: list[dict[str, Any]] = []
    for name, class_name, height_m in AREAS:
        fluents += boxed(name, class_name, height_m)
    for name, class_name, has_box in OBJECTS_SEEN:
        found = list(boxed(name, class_name, 0.75))
        fluents += found if has_box else [{"name": name, "class": class_name}]
    for name, class_name in FURNITURE:
        fluents += boxed(name, class_name, 0.0)
    return fluents


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    with (
        ServiceProcess(tmp_path_factory.mktemp("restaurant")) as service,
        httpx.Client(base_url=service.address, trust_env=False) as client,
    ):
        reply = client.post("/fluents", json={"fluents": restaurant()})
        assert reply.status_code == 201, reply.text
        yield client


def rows(board: httpx.Client, query: str, variable: str, **params: str) -> list[str]:
    reply = board.get("/sparql", params={"query": query, **params})
    assert reply.status_code == 200, reply.text
    bindings = reply.json()["results"]["bindings"]
    return sorted(row[variable]["value"].removeprefix(FLUENT) for row in bindings)


def test_floor_areas_are_the_areas_with_a_box_at_height_zero(board: httpx.Client) -> None:
    assert rows(board, FLOOR_AREAS, "area") == [
        "manipulationAreaEastCounter1",
        "premanipulationAreaEastCounter1",
    ]


def test_objects_are_kitchenware_and_personal_items_with_a_box(board: httpx.Client) -> None:
    assert rows(board, OBJECTS, "instance") == ["coffee1", "mug7", "plate1"]


def test_ended_objects_stay_in_the_answer_unless_a_time_is_given(board: httpx.Client) -> None:
    board.post("/fluents", json=list(boxed("cup9", "Mug", 0.75))).raise_for_status()
    board.post("/fluents/cup9/end", json={"at": 100.0}).raise_for_status()
    assert "cup9" in rows(board, OBJECTS, "instance")
    assert "cup9" not in rows(board, OBJECTS, "instance", at="now")


@pytest.mark.parametrize("listing", ["listing_2_2.yaml", "listing_4_1.yaml", "listing_4_2.yaml"])
def test_the_listings_of_the_thesis_are_imported(board: httpx.Client, listing: str) -> None:
    text = (Path(__file__).parents[1] / "golden" / listing).read_text()
    reply = board.post("/import", content=text, headers={"Content-Type": "application/yaml"})
    assert reply.status_code == 200, reply.text
