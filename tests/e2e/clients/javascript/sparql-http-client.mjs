// Asks the board with sparql-http-client, unmodified: queries, updates and the graph store.
// Usage: node sparql-http-client.mjs SPARQL-ADDRESS GRAPH-STORE-ADDRESS

import { Readable } from "node:stream";

import rdf from "@rdfjs/data-model";
import SimpleClient from "sparql-http-client/SimpleClient.js";
import StreamClient from "sparql-http-client";
import ParsingClient from "sparql-http-client/ParsingClient.js";

const [endpointUrl, storeUrl] = process.argv.slice(2);
const addresses = { endpointUrl, updateUrl: endpointUrl, storeUrl };
const client = new ParsingClient(addresses);

const rows = await client.query.select("SELECT ?mug WHERE { ?mug a race:Mug } ORDER BY ?mug");
const asked = await client.query.ask("ASK { ?mug a race:Mug }");
const made = await client.query.construct("CONSTRUCT { ?mug a race:Dish } WHERE { ?mug a race:Mug }");
await client.query.update("INSERT DATA { GRAPH <urn:shc> { <urn:a> <urn:b> 1 } }");
const written = await client.query.ask("ASK { GRAPH <urn:shc> { <urn:a> <urn:b> 1 } }");

const graph = rdf.namedNode("urn:shc-store");
const quad = (subject, value) =>
  rdf.quad(rdf.namedNode(subject), rdf.namedNode("urn:b"), rdf.literal(value), graph);
const streaming = new StreamClient(addresses);
await streaming.store.put(Readable.from([quad("urn:a", "c")]), { graph });
await streaming.store.post(Readable.from([quad("urn:d", "e")]), { graph });
const count = async (stream) => {
  let found = 0;
  for await (const entry of stream) {
    found += entry ? 1 : 0;
  }
  return found;
};
const stored = await count(streaming.store.get(graph));
const streamed = await count(streaming.query.select("SELECT ?mug WHERE { ?mug a race:Mug }"));
const raw = await new SimpleClient(addresses).query.ask("ASK { ?mug a race:Mug }");
console.log(
  JSON.stringify({
    mugs: rows.map((row) => row.mug.value),
    asked,
    made: [...made].length,
    written,
    stored,
    streamed,
    raw: (await raw.json()).boolean,
  }),
);
