"""What an update is evaluated to is what Oxigraph would have done, however operations follow."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import pyoxigraph as ox
from hypothesis import given, settings
from hypothesis import strategies as st

from fluentboard.board.blackboard import Blackboard

SUBJECTS = ["ex:a", "ex:b", "ex:c"]
PREDICATES = ["ex:p", "ex:q", "rdf:type"]
OBJECTS = ["ex:a", "ex:b", "1", "1.0", "'x'", "'x'@en"]
GRAPHS = ["ex:g", "ex:h"]
PROLOGUE = "PREFIX ex: <http://ex/>\nPREFIX rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#>\n"
PATTERNS = [
    "?s ?p ?o",
    "?s ex:p ?o",
    "GRAPH ?g { ?s ?p ?o }",
    "GRAPH ex:g { ?s ?p ?o }",
    "?s ex:p ?o . OPTIONAL { ?o ex:q ?z } BIND(ex:q AS ?p)",
    "?s ?p ?o . FILTER NOT EXISTS { GRAPH ?other { ?s ?p ?o } }",
    "?s ex:p|ex:q ?o . MINUS { ?s a ?o } BIND(ex:p AS ?p)",
    "?s ex:p+ ?o . BIND(rdf:type AS ?p)",
    "?s ex:p* ?o . BIND(ex:q AS ?p)",
    "{ SELECT ?s (COUNT(*) AS ?o) { ?s ?x ?y } GROUP BY ?s } BIND(ex:q AS ?p)",
    "{ ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } }",
    "VALUES (?s ?p ?o) { (ex:a ex:p 2) (UNDEF ex:q ex:c) }",
]
TEMPLATES = [
    "?s ?p ?o",
    "GRAPH ex:g { ?s ?p ?o }",
    "GRAPH ?g { ?s ?p ?o }",
    "?o ?p ?s",
    "GRAPH ex:h { ?s ex:q ?o . ?s ?p ex:b }",
    "?s ex:p ?o . GRAPH ex:h { ?o a ?s }",
]

triples = st.builds(
    "{} {} {}".format, *(st.sampled_from(terms) for terms in (SUBJECTS, PREDICATES, OBJECTS))
)


def _data(default: list[str], graph: str, named: list[str]) -> str:
    inside = f"GRAPH {graph} {{ {' . '.join(named)} }}" if named else ""
    return f"{' . '.join(default)} {inside}"


data = st.builds(
    _data, st.lists(triples, max_size=3), st.sampled_from(GRAPHS), st.lists(triples, max_size=3)
)


def _transfer(word: str, source: str, target: str) -> str:
    # From a graph that is not there, the engine copies nothing and clears the target; SPARQL says
    # that this is an error, which SILENT passes over.
    there = "" if source == "DEFAULT" else f"CREATE SILENT GRAPH {source} ; "
    return f"{there}{word} SILENT {source} TO {target}"


targets = st.sampled_from(["DEFAULT", "NAMED", "ALL", *(f"GRAPH {graph}" for graph in GRAPHS)])
ends = st.sampled_from(["DEFAULT", *GRAPHS])
datasets = st.sampled_from(["", "USING ex:g", "USING NAMED ex:h", "USING ex:h USING NAMED ex:g"])


@st.composite
def modifications(draw: st.DrawFn) -> str:
    pattern, delete = draw(st.sampled_from(PATTERNS)), draw(st.sampled_from(TEMPLATES))
    insert, dataset = draw(st.sampled_from(TEMPLATES)), draw(datasets)
    form = draw(st.sampled_from(["delete", "insert", "both", "with"]))
    text = f"DELETE {{ {delete} }} " if form != "insert" else ""
    text += f"INSERT {{ {insert} }} " if form != "delete" else ""
    front = "WITH ex:g " if form == "with" else ""
    return f"{front}{text}{dataset} WHERE {{ {pattern} }}"


operations = st.one_of(
    data.map("INSERT DATA {{ {} }}".format),
    data.map("DELETE DATA {{ {} }}".format),
    st.sampled_from(TEMPLATES).map("DELETE WHERE {{ {} }}".format),
    modifications(),
    modifications(),
    st.builds("{} SILENT {}".format, st.sampled_from(["CLEAR", "DROP"]), targets),
    st.sampled_from(GRAPHS).map("CREATE SILENT GRAPH {}".format),
    st.builds(_transfer, st.sampled_from(["ADD", "COPY", "MOVE"]), ends, ends),
)


def contents(quads: Sequence[ox.Quad]) -> set[str]:
    return {str(quad) for quad in quads}


@given(requests=st.lists(st.lists(operations, min_size=1, max_size=4), min_size=1, max_size=3))
@settings(max_examples=150)
def test_updates_do_what_the_engine_would_do(requests: list[list[str]]) -> None:
    engine = ox.Store()
    with Blackboard.open(None, builtin_ontologies=False) as board:
        for request in requests:
            text = PROLOGUE + " ;\n".join(request)
            engine.update(text)
            board.graphs.update(text, "test").result()
            assert contents(list(board.graphs.statements())) == contents(list(engine))
        whole = " ;\n".join(operation for request in requests for operation in request)
        with Blackboard.open(None, builtin_ontologies=False) as other:
            other.graphs.update(PROLOGUE + whole, "test").result()
            assert contents(list(other.graphs.statements())) == contents(list(engine))


@given(requests=st.lists(operations, min_size=1, max_size=6))
@settings(max_examples=15)
def test_journal_alone_gives_the_same_statements_and_graphs(requests: list[str]) -> None:
    with tempfile.TemporaryDirectory(prefix="fluentboard-test-") as name:
        folder = Path(name)
        with Blackboard.open(folder, builtin_ontologies=False, durability="process") as board:
            for request in requests:
                board.graphs.update(PROLOGUE + request, "test").result()
            said, graphs = list(board.graphs.statements()), set(board.graphs.named_graphs())
        for file in (folder / "store").iterdir():
            file.unlink()
        with Blackboard.open(folder, builtin_ontologies=False) as board:
            assert contents(list(board.graphs.statements())) == contents(said)
            assert set(board.graphs.named_graphs()) == graphs
