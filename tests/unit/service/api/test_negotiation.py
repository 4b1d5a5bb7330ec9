from __future__ import annotations

import pytest

from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.errors import NotAcceptable

OFFERS = (
    Offer("application/sparql-results+json", "json"),
    Offer("application/sparql-results+xml", "xml"),
    Offer("text/csv", "csv"),
)


@pytest.mark.parametrize(
    ("accept", "expected"),
    [
        (None, "json"),
        ("", "json"),
        ("*/*", "json"),
        ("*", "json"),
        ("text/csv", "csv"),
        ("TEXT/CSV", "csv"),
        ("text/*", "csv"),
        ("text/csv;q=0.5, application/sparql-results+xml", "xml"),
        ("text/csv;q=0.5, */*;q=0.1", "csv"),
        ("application/sparql-results+json;q=0, */*", "xml"),
        ("application/*;q=0.3, text/*;q=0.4", "csv"),
        ("text/csv; charset=utf-8; q=0.9, application/sparql-results+xml;q=0.8", "csv"),
        ("text/html, application/xhtml+xml, */*;q=0.8", "json"),
        ("nonsense, text/csv", "csv"),
    ],
)
def test_the_most_wanted_offer_is_chosen(accept: str | None, expected: str) -> None:
    assert negotiated(accept, OFFERS).format == expected


@pytest.mark.parametrize("accept", ["image/png", "text/csv;q=0", "*/*;q=0", "text/csv;q=nonsense"])
def test_what_cannot_be_produced_is_refused_with_what_can(accept: str) -> None:
    with pytest.raises(NotAcceptable, match="available are") as refusal:
        negotiated(accept, OFFERS)
    assert "text/csv" in refusal.value.detail["available"]
