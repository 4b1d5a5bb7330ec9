// Subscribes with sepa-js, unmodified, and prints what it is told while the script updates the board.
// Usage: node sepa.mjs JSAP-ADDRESS

import sepajs from "@arces-wot/sepa-js";

const jsap = await (await fetch(process.argv[2])).json();
const sepa = new sepajs.SEPA(jsap);
const told = [];

// What was there before the script subscribed.
const before = await sepa.query("SELECT ?cup { GRAPH <urn:js> { ?cup a <urn:Cup> } }");
told.push({ query: before.results.bindings.length });

const subscription = sepa.subscribe(
  "SELECT ?cup { GRAPH <urn:js> { ?cup a <urn:Cup> } }",
  undefined,
  "cups",
);
const steps = [
  "INSERT DATA { GRAPH <urn:js> { <urn:cup1> a <urn:Cup> } }",
  "DELETE DATA { GRAPH <urn:js> { <urn:cup1> a <urn:Cup> } }",
];

subscription.on("error", (problem) => {
  console.error(problem.toString());
  process.exit(1);
});
subscription.on("notification", async (notification) => {
  const { sequence, addedResults, removedResults } = notification;
  const cups = (results) => (results.results?.bindings ?? []).map((row) => row.cup.value);
  told.push({ sequence, added: cups(addedResults), removed: cups(removedResults) });
  const step = steps.shift();
  if (step === undefined) {
    subscription.unsubscribe();
  } else {
    await sepa.update(step);
  }
});
subscription.on("unsubscribed", () => {
  console.log(JSON.stringify(told));
  process.exit(0);
});
