"""Vocabulary: what the loaded ontologies declare, and how short names become IRIs."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping

import pyoxigraph as ox

from fluentboard.errors import InvalidName, InvalidOntology, UnknownClass
from fluentboard_ontology import FB, PREFIXES

RDF = PREFIXES["rdf"]
RDFS = PREFIXES["rdfs"]
OWL = PREFIXES["owl"]
XSD = PREFIXES["xsd"]

RDF_TYPE = RDF + "type"
SUB_CLASS_OF = RDFS + "subClassOf"
PROPER_SUB_CLASS_OF = FB + "properSubClassOf"
"""Materialised `rdfs:subClassOf+`."""
SUB_CLASS_OF_OR_SAME = FB + "subClassOfOrSame"
"""Materialised `rdfs:subClassOf*`."""

_CLASS_TYPES = frozenset({OWL + "Class", RDFS + "Class"})
_PROPERTY_TYPES = frozenset(
    {OWL + "ObjectProperty", OWL + "DatatypeProperty", OWL + "AnnotationProperty", RDF + "Property"}
)

Statement = tuple[str, str, str]
"""Subject, predicate and object in N-Triples syntax."""


def parse_statements(text: str, source: str, base_iri: str | None = None) -> list[ox.Triple]:
    """The triples of an ontology in Turtle (RDF/XML if it starts with `<`).

    Raises:
        InvalidOntology: the text does not parse; the message says where.
    """
    is_xml = text.lstrip("\ufeff \t\r\n").startswith(("<?xml", "<rdf:RDF", "<!DOCTYPE"))
    form = ox.RdfFormat.RDF_XML if is_xml else ox.RdfFormat.TURTLE
    try:
        return [quad.triple for quad in ox.parse(text, format=form, base_iri=base_iri)]
    except (SyntaxError, ValueError) as problem:
        raise InvalidOntology(f"{source} does not parse: {problem}") from None


def declares_class(triple: ox.Triple) -> bool:
    """The triple declares a class."""
    return (
        triple.predicate.value == RDF_TYPE
        and isinstance(triple.object, ox.NamedNode)
        and triple.object.value in _CLASS_TYPES
    )


def is_declaration(triple: ox.Triple) -> bool:
    """The triple declares a class or property, or relates two classes."""
    if triple.predicate.value == SUB_CLASS_OF or declares_class(triple):
        return True
    return (
        triple.predicate.value == RDF_TYPE
        and isinstance(triple.object, ox.NamedNode)
        and triple.object.value in _PROPERTY_TYPES
    )


class Vocabulary:
    """Classes, properties and the class hierarchy. Immutable: a new ontology makes a new one.

    Args:
        statements: the triples of all loaded ontologies.
        said: declarations made by updates. What they declare goes by prefixed name or IRI; short
            names are the ontologies', so that a fluent's class never changes its meaning.
    """

    def __init__(
        self, statements: Iterable[ox.Triple] = (), said: Iterable[ox.Triple] = ()
    ) -> None:
        self._classes: dict[str, str] = {}
        self._properties: dict[str, str] = {}
        self._canonical: dict[str, str] = {}
        self._labels: dict[str, str] = {}
        self._aliases: dict[str, list[str]] = {}
        parents: dict[str, set[str]] = {}
        for triple in statements:
            self._note(triple, parents, self._declare)
            if triple.predicate.value == RDFS + "label" and isinstance(
                triple.subject, ox.NamedNode
            ):
                label: str = getattr(triple.object, "value", "")
                self._labels.setdefault(triple.subject.value, label)
        for triple in said:
            self._note(triple, parents, self._declare_by_iri)
        for iri in self._canonical:
            if self._classes.get(self._canonical[iri]) == iri:
                parents.setdefault(f"<{iri}>", set())
        self._above = {node: _reachable(node, parents) for node in parents}
        self._below: dict[str, set[str]] = {}
        for node, above in self._above.items():
            for ancestor in above:
                self._below.setdefault(ancestor, set()).add(node)

    def _note(
        self,
        triple: ox.Triple,
        parents: dict[str, set[str]],
        declare: Callable[[dict[str, str], str], None],
    ) -> None:
        target = triple.object
        if triple.predicate.value == RDF_TYPE and isinstance(triple.subject, ox.NamedNode):
            kind = target.value if isinstance(target, ox.NamedNode) else ""
            if kind in _CLASS_TYPES:
                declare(self._classes, triple.subject.value)
            elif kind in _PROPERTY_TYPES:
                declare(self._properties, triple.subject.value)
        elif triple.predicate.value == SUB_CLASS_OF:
            parents.setdefault(str(triple.subject), set()).add(str(target))
            parents.setdefault(str(target), set())

    def _declare(self, table: dict[str, str], iri: str) -> None:
        local = _local_name(iri)
        # The first to claim a short name keeps it; a later namesake goes by prefix or IRI.
        if table.setdefault(local, iri) == iri:
            self._canonical[iri] = local
        else:
            table[iri] = iri
            self._canonical[iri] = iri

    def _declare_by_iri(self, table: dict[str, str], iri: str) -> None:
        if iri in self._canonical:
            return
        table[iri] = iri
        self._canonical[iri] = iri
        if table is self._classes:
            self._aliases.setdefault(_local_name(iri), []).append(iri)

    def class_iri(self, name: str) -> str:
        """The IRI of a class given by short name, prefixed name or IRI.

        Raises:
            UnknownClass: no loaded ontology declares it; the message offers what is close.
        """
        iri = self._classes.get(name)
        if iri is not None:
            return iri
        iri = expanded(name)
        short = self._canonical.get(iri)
        if short is not None and self._classes.get(short) == iri:
            return iri
        aliases = self._aliases.get(name, ())
        if len(aliases) == 1:
            return aliases[0]
        close = difflib.get_close_matches(_local_name(name), self._classes, n=3, cutoff=0.6)
        hint = f"did you mean {' or '.join(close)}?" if close else "GET /classes lists them all."
        raise UnknownClass(
            f"no loaded ontology declares the class {name!r}; {hint} "
            "A class of your own is added with `fluentboard serve --ontology FILE`, or by saying "
            "that it is an owl:Class with a SPARQL update",
            name=name,
            suggestions=close,
        )

    def class_name(self, name: str) -> str:
        """The short name by which the board knows a class.

        Raises:
            UnknownClass: no loaded ontology declares it.
        """
        return name if name in self._classes else self._canonical[self.class_iri(name)]

    def property_iri(self, name: str) -> str:
        """The IRI of a property; an undeclared plain name is put into `upper`.

        Raises:
            InvalidName: the name has an unknown prefix.
        """
        iri = self._properties.get(name)
        if iri is not None:
            return iri
        if ":" not in name:
            return PREFIXES["upper"] + name
        return expanded(name)

    def property_name(self, name: str) -> str:
        """The short name by which the board knows a property; an undeclared one stays as it is."""
        if name in self._properties or ":" not in name:
            return name
        iri = expanded(name)
        return self._canonical.get(iri, iri)

    def declares_property(self, name: str) -> bool:
        """A loaded ontology declares the property."""
        return name in self._properties or (
            ":" in name and self._canonical.get(expanded(name), "") in self._properties
        )

    def classes(self) -> list[str]:
        """IRIs of all declared classes, sorted."""
        return sorted(iri for iri in self._classes.values())

    def properties(self) -> list[str]:
        """IRIs of all declared properties, sorted."""
        return sorted(iri for iri in self._properties.values())

    def label(self, iri: str) -> str:
        """The label of a class or property, or its short name."""
        return self._labels.get(iri) or self.short(iri)

    def short(self, iri: str) -> str:
        """The short name of a class or property, or the IRI if it has none."""
        return self._canonical.get(iri, iri)

    def superclasses(self, iri: str) -> frozenset[str]:
        """IRIs of the class and of all named classes above it."""
        return self._named(self._above.get(f"<{iri}>", set()), iri)

    def subclasses(self, iri: str) -> frozenset[str]:
        """IRIs of the class and of all named classes below it."""
        return self._named(self._below.get(f"<{iri}>", set()), iri)

    def is_node(self, iri: str) -> bool:
        """The IRI takes part in the materialised class hierarchy."""
        return f"<{iri}>" in self._above

    def closure(self) -> set[Statement]:
        """The transitive class hierarchy as statements of the two closure predicates."""
        found: set[Statement] = set()
        for node, above in self._above.items():
            found.add((node, f"<{SUB_CLASS_OF_OR_SAME}>", node))
            for ancestor in above:
                found.add((node, f"<{PROPER_SUB_CLASS_OF}>", ancestor))
                found.add((node, f"<{SUB_CLASS_OF_OR_SAME}>", ancestor))
        return found

    @staticmethod
    def _named(nodes: Iterable[str], itself: str) -> frozenset[str]:
        return frozenset((itself, *(node[1:-1] for node in nodes if node[0] == "<")))


def expanded(name: str, prefixes: Mapping[str, str] = PREFIXES) -> str:
    """The IRI that a prefixed name or an IRI stands for.

    Raises:
        InvalidName: the prefix is unknown.
    """
    prefix, colon, local = name.partition(":")
    if colon and not local.startswith("//") and prefix in prefixes:
        return prefixes[prefix] + local
    if colon and (local.startswith("//") or prefix in ("urn", "mailto", "tag")):
        return name
    if not colon:
        return name
    raise InvalidName(
        f"{name!r} has the unknown prefix {prefix!r}; known are {', '.join(sorted(prefixes))}, "
        "or write the whole IRI"
    )


def _local_name(iri: str) -> str:
    return iri.rpartition("#")[2] if "#" in iri else iri.rpartition("/")[2].rpartition(":")[2]


def _reachable(start: str, parents: Mapping[str, set[str]]) -> set[str]:
    """Nodes reached by at least one step; contains `start` itself only on a cycle."""
    seen: set[str] = set()
    waiting = list(parents[start])
    while waiting:
        node = waiting.pop()
        if node not in seen:
            seen.add(node)
            waiting.extend(parents.get(node, ()))
    return seen
