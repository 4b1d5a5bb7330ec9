// Asks the board with Comunica, unmodified: as a SPARQL endpoint, and as an RDF source of its own.
// Usage: node comunica.mjs SPARQL-ADDRESS GRAPH-ADDRESS

import { QueryEngine } from "@comunica/query-sparql";

const [endpoint, graph] = process.argv.slice(2);
const engine = new QueryEngine();
const sources = [{ type: "sparql", value: endpoint }];
const RACE = "PREFIX race: <https://w3id.org/fluentboard/race#> PREFIX upper: <https://w3id.org/fluentboard/upper#> ";

const rows = await (
  await engine.queryBindings(
    RACE + "SELECT ?mug ?size WHERE { ?mug a race:Mug ; upper:hasXSize ?size } ORDER BY ?mug",
    { sources },
  )
).toArray();
const asked = await engine.queryBoolean(RACE + "ASK { ?mug a race:Mug }", { sources });
const quads = await (
  await engine.queryQuads(RACE + "CONSTRUCT { ?mug a race:Dish } WHERE { ?mug a race:Mug }", { sources })
).toArray();
await engine.queryVoid("INSERT DATA { GRAPH <urn:comunica> { <urn:a> <urn:b> 'c' } }", {
  sources,
  destination: { type: "sparql", value: endpoint },
});
const written = await engine.queryBoolean("ASK { GRAPH <urn:comunica> { <urn:a> <urn:b> 'c' } }", {
  sources: [{ type: "sparql", value: endpoint }],
});
console.log(
  JSON.stringify({
    mugs: rows.map((row) => row.get("mug").value),
    size: rows[0].get("size").value,
    asked,
    quads: quads.length,
    written,
  }),
);
process.exit(0);
