"""The ontologies as RDF/XML files, for tools that do not read Turtle (owlready2, older editors)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fluentboard_ontology import ONTOLOGIES, read

if TYPE_CHECKING:
    import rdflib


def to_rdfxml(name: str) -> str:
    """An ontology as RDF/XML, rules and imports included.

    Raises:
        ValueError: there is no ontology of that name.
        ImportError: rdflib is not installed.
    """
    return _graph(read(name)).serialize(format="xml")


def write_owl_files(folder: Path) -> list[Path]:
    """Writes `upper.owl`, `furniture.owl` and `race.owl` into a folder, which is made if needed.

    owlready2 finds the imported ontologies there once the folder is in its `onto_path`.

    Returns:
        The files, each after those it imports.

    Raises:
        ImportError: rdflib is not installed.
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    for name in ONTOLOGIES:
        file = folder / f"{name}.owl"
        file.write_text(to_rdfxml(name), encoding="utf-8")
        paths.append(file)
    return paths


def _graph(turtle: str) -> rdflib.Graph:
    try:
        import rdflib
    except ImportError as problem:
        raise ImportError(
            "writing RDF/XML needs rdflib; install fluentboard[service] or fluentboard[mapping]"
        ) from problem
    return rdflib.Graph().parse(data=turtle, format="turtle")
