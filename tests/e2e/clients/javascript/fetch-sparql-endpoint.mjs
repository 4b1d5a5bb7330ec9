// Asks the board with fetch-sparql-endpoint, unmodified.
// Usage: node fetch-sparql-endpoint.mjs SPARQL-ADDRESS

import { SparqlEndpointFetcher } from "fetch-sparql-endpoint";

const endpoint = process.argv[2];
const fetcher = new SparqlEndpointFetcher();

async function all(stream) {
  const found = [];
  for await (const entry of stream) {
    found.push(entry);
  }
  return found;
}

const rows = await all(
  await fetcher.fetchBindings(endpoint, "SELECT ?mug WHERE { ?mug a race:Mug } ORDER BY ?mug"),
);
const asked = await fetcher.fetchAsk(endpoint, "ASK { ?mug a race:Mug }");
const triples = await all(
  await fetcher.fetchTriples(endpoint, "CONSTRUCT { ?mug a race:Dish } WHERE { ?mug a race:Mug }"),
);
await fetcher.fetchUpdate(endpoint, "INSERT DATA { GRAPH <urn:fetcher> { <urn:a> <urn:b> 1 } }");
const written = await fetcher.fetchAsk(endpoint, "ASK { GRAPH <urn:fetcher> { <urn:a> <urn:b> 1 } }");
let refused = "";
try {
  await all(await fetcher.fetchBindings(endpoint, "SELECT * WHERE { nonsense"));
} catch (problem) {
  refused = problem.message;
}
console.log(
  JSON.stringify({ mugs: rows.map((row) => row.mug.value), asked, triples: triples.length, written, refused }),
);
