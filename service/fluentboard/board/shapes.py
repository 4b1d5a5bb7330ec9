"""Shapes: SHACL constraints that a batch must meet, or nothing of it is stored.

pySHACL validates, which is the one place that imports it. What it sees are the fluents that a batch
changes, as they would be afterwards, and what they refer to, two steps far; its focus are the
changed ones. A shape whose target is none of their classes costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

from fluentboard.board.triples import fluent_iri, fluent_lines, fluent_name
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.errors import InvalidConfiguration, MissingExtra, ShapeViolation
from fluentboard.model.fluent import Fluent

_SH = "http://www.w3.org/ns/shacl#"
_RDF_TYPE = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
_SUB_CLASS_OF = "http://www.w3.org/2000/01/rdf-schema#subClassOf"
_STEPS = 2
_TOLD_MAX = 50

LookUp = Callable[[str], Fluent | None]
"""Gives a fluent as it would be after the batch, or None."""


class ShapesGuard:
    """Refuses batches that violate a shape. Threads that share one take turns.

    Args:
        files: shapes in Turtle, RDF/XML or JSON-LD.

    Raises:
        MissingExtra: pySHACL is not installed.
        InvalidConfiguration: a file cannot be read, or does not hold shapes.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        try:
            import pyshacl
            import rdflib
        except ModuleNotFoundError as problem:
            raise MissingExtra(
                f"shapes need the extra 'shacl' ({problem.name} is missing); install it with: "
                "pip install 'fluentboard[service,shacl]'"
            ) from None
        self._taking_turns = Lock()
        self._pyshacl: Any = pyshacl
        self._rdflib: Any = rdflib
        self._shapes: Any = rdflib.Graph()
        for file in files:
            try:
                self._shapes.parse(file)
            # rdflib's parsers raise a wide range of types.
            except Exception as problem:
                raise InvalidConfiguration(f"cannot read the shapes {file}: {problem}") from None
        self._classes, self._has_other_targets = self._targets()
        if not self._classes and not self._has_other_targets:
            names = ", ".join(map(str, files))
            raise InvalidConfiguration(f"there is no shape with a target in {names}")
        # Finds mistakes in the shapes now rather than at the first write.
        self._violations(rdflib.Graph(), [])

    def check(self, changed: Sequence[Fluent], vocabulary: Vocabulary, look_up: LookUp) -> None:
        """Lets a batch pass, or not.

        Args:
            changed: the fluents of the batch, as they would be after it.
            vocabulary: gives short names their IRIs, and classes their superclasses.
            look_up: gives other fluents.

        Raises:
            ShapeViolation: with what pySHACL reports.
        """
        fluents = {fluent.name: fluent for fluent in changed}
        aimed = [f for f in fluents.values() if self._is_aimed_at(f, vocabulary)]
        if not aimed:
            return
        focus = [self._rdflib.URIRef(fluent_iri(fluent.name)) for fluent in aimed]
        with self._taking_turns:
            found = self._violations(self._graph(aimed, vocabulary, look_up), focus)
        if found:
            first = found[0]
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            raise ShapeViolation(
                f"{first['fluent']!r} violates a shape of this board: {first['message']}{more}; "
                "nothing was stored",
                violations=found[:_TOLD_MAX],
            )

    def _targets(self) -> tuple[frozenset[str], bool]:
        """The classes that shapes aim at, and whether some aim in another way."""
        uri, shapes = self._rdflib.URIRef, self._shapes
        classes = {str(target) for target in shapes.objects(None, uri(_SH + "targetClass"))}
        for shape in shapes.subjects(uri(_RDF_TYPE), uri(_SH + "NodeShape")):
            # A shape that is a class aims at its own members.
            if (shape, uri(_RDF_TYPE), None) in shapes and not isinstance(
                shape, self._rdflib.BNode
            ):
                classes.add(str(shape))
        others = ("targetNode", "targetSubjectsOf", "targetObjectsOf", "target")
        return frozenset(classes), any((None, uri(_SH + name), None) in shapes for name in others)

    def _is_aimed_at(self, fluent: Fluent, vocabulary: Vocabulary) -> bool:
        if self._has_other_targets:
            return True
        above = vocabulary.superclasses(vocabulary.class_iri(fluent.class_name))
        return not self._classes.isdisjoint(above)

    def _graph(self, aimed: Sequence[Fluent], vocabulary: Vocabulary, look_up: LookUp) -> Any:
        graph = self._rdflib.Graph()
        lines: list[str] = []
        seen: set[str] = set()
        here = list(aimed)
        for _ in range(_STEPS + 1):
            further: dict[str, None] = {}
            for fluent in here:
                if fluent.name in seen:
                    continue
                seen.add(fluent.name)
                lines += fluent_lines(fluent, vocabulary)
                class_iri = vocabulary.class_iri(fluent.class_name)
                lines += [
                    f"<{class_iri}> <{_SUB_CLASS_OF}> <{above}> .\n"
                    for above in vocabulary.superclasses(class_iri)
                    if above != class_iri
                ]
                further.update((str(p.value), None) for p in fluent.properties if p.is_reference)
            here = [found for name in further if (found := look_up(name)) is not None]
        graph.parse(data="".join(lines), format="nt")
        return graph

    def _violations(self, graph: Any, focus: Sequence[Any]) -> list[dict[str, str]]:
        try:
            _, report, _ = self._pyshacl.validate(
                graph,
                shacl_graph=self._shapes,
                focus_nodes=list(focus) or None,
                inference="none",
                allow_infos=True,
                allow_warnings=True,
            )
        # Mistakes in shapes show as a wide range of types.
        except Exception as problem:
            raise InvalidConfiguration(f"the shapes cannot be applied: {problem}") from None
        uri = self._rdflib.URIRef
        violations: list[dict[str, str]] = []
        is_a_violation = report.subjects(uri(_SH + "resultSeverity"), uri(_SH + "Violation"))
        for result in is_a_violation:
            told = {
                name: str(value)
                for name in ("focusNode", "resultPath", "value", "resultMessage", "sourceShape")
                for value in report.objects(result, uri(_SH + name))
            }
            component = next(iter(report.objects(result, uri(_SH + "sourceConstraintComponent"))))
            node = told.get("focusNode", "")
            violations.append(
                {
                    "fluent": fluent_name(node) or node,
                    "path": told.get("resultPath", ""),
                    "value": told.get("value", ""),
                    "message": told.get("resultMessage", ""),
                    "constraint": str(component).removeprefix(_SH),
                    "shape": told.get("sourceShape", ""),
                }
            )
        return sorted(violations, key=lambda v: (v["fluent"], v["path"], v["message"]))
