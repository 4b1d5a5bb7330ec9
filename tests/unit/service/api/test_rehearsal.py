"""What a reader is to rehearse arrives as it was sent, and is sent only where that helps."""

from __future__ import annotations

import pytest

from fluentboard.api.readers.rehearsal import Rehearsal, needs_rehearsal
from fluentboard.board.update_syntax import parse_update

WHERE = "INSERT { GRAPH ?g { ?s ?p [] } } WHERE { ?s ?p ?o . GRAPH ?g { ?s a race:Mug } }"


def test_operations_arrive_as_they_were_sent() -> None:
    text = f"CREATE GRAPH <urn:g> ; INSERT DATA {{ <urn:a> <urn:b> 'c'@en, 1.5, _:d }} ; {WHERE}"
    operations = parse_update(f"{text} ; CLEAR ALL ; COPY DEFAULT TO <urn:g>")
    sent = Rehearsal.of(operations, "ASK {}")
    assert Rehearsal.unpacked(sent.packed()) == sent
    assert sent.operations == tuple(operations)


def test_what_would_be_loaded_from_the_web_is_left_out() -> None:
    operations = parse_update(f"LOAD <http://example.org/> ; {WHERE}")
    assert len(Rehearsal.of(operations).operations) == 1


@pytest.mark.parametrize(
    ("text", "needs"),
    [
        (WHERE, False),
        ("INSERT DATA { <urn:a> <urn:b> 1 } ; CLEAR ALL", False),
        (f"INSERT DATA {{ <urn:a> <urn:b> 1 }} ; {WHERE}", True),
        (f"{WHERE} ; {WHERE}", True),
    ],
)
def test_only_a_pattern_behind_another_operation_needs_one(text: str, needs: bool) -> None:
    assert needs_rehearsal(parse_update(text)) == needs
