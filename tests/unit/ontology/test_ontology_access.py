"""What `import fluentboard_ontology` offers, without any RDF library."""

from __future__ import annotations

import subprocess
import sys

import pytest

import fluentboard_ontology
from fluentboard_ontology import ONTOLOGIES, PREFIXES, ontology_iri, path, read


def test_every_ontology_can_be_read() -> None:
    assert set(ONTOLOGIES) == {"upper", "race", "furniture"}
    for name in ONTOLOGIES:
        assert f"<{ontology_iri(name)}> a owl:Ontology" in read(name)


def test_path_leads_to_the_same_text() -> None:
    assert path("upper").read_text(encoding="utf-8") == read("upper")
    assert path("upper").name == "upper.ttl"


def test_unknown_ontology_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'kitchen'; there are upper, furniture, race"):
        read("kitchen")


def test_a_name_cannot_leave_the_package() -> None:
    with pytest.raises(ValueError, match="no ontology is called"):
        path("../fluentboard_ontology/upper")


def test_namespaces_are_fixed() -> None:
    base = "https://w3id.org/fluentboard/"
    assert PREFIXES["upper"] == fluentboard_ontology.UPPER == base + "upper#"
    assert PREFIXES["race"] == fluentboard_ontology.RACE == base + "race#"
    assert PREFIXES["furniture"] == fluentboard_ontology.FURNITURE == base + "furniture#"
    assert PREFIXES["fb"] == fluentboard_ontology.FB == base + "board#"
    assert PREFIXES["fluent"] == fluentboard_ontology.FLUENT == base + "fluent/"


def test_prefixes_cannot_be_changed_by_a_user() -> None:
    with pytest.raises(TypeError):
        PREFIXES["upper"] = "http://example.org/"  # type: ignore[index]


def test_importing_the_package_imports_no_rdf_library_and_nothing_of_ours() -> None:
    code = (
        "import sys; import fluentboard_ontology; "
        "print([m for m in sys.modules if m.split('.')[0] in "
        "('rdflib', 'pyoxigraph', 'owlready2', 'fluentboard', 'numpy', 'yaml')])"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
