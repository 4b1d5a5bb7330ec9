// YASGUI as it is published, in the page of another origin: a query is typed, run and shown as a table.
// jsdom is the page; it lays nothing out, and has no fetch, so Node's is used under a browser's rules
// for other origins.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { JSDOM } from "jsdom";

const [endpoint] = process.argv.slice(2);
const ORIGIN = "http://yasgui.example.org";
const SIMPLE = new Set(["accept", "accept-language", "content-language"]);
const requests = [];

/** What a browser does for a page of another origin: asks first where it has to, and hides replies. */
async function fetchAsBrowser(...what) {
  const request = new Request(...what);
  const { headers, method } = request;
  const type = (headers.get("content-type") ?? "").split(";")[0];
  const unusual = [...headers.keys()].filter(
    (name) => !SIMPLE.has(name) && !(name === "content-type" && type === "application/x-www-form-urlencoded"),
  );
  const asks = unusual.length > 0 || !["GET", "HEAD", "POST"].includes(method);
  if (asks) {
    const preflight = await fetch(request.url, {
      method: "OPTIONS",
      headers: {
        origin: ORIGIN,
        "access-control-request-method": method,
        "access-control-request-headers": unusual.join(", "),
      },
    });
    const allowed = (preflight.headers.get("access-control-allow-headers") ?? "").toLowerCase().split(/, */);
    if (preflight.headers.get("access-control-allow-origin") !== ORIGIN) throw new TypeError("no preflight");
    for (const name of unusual) if (!allowed.includes(name)) throw new TypeError(`may not send ${name}`);
  }
  headers.set("origin", ORIGIN);
  const reply = await fetch(request);
  requests.push({ method, asks, status: reply.status });
  if (reply.headers.get("access-control-allow-origin") !== ORIGIN) throw new TypeError("hidden from the page");
  return reply;
}

const { window } = new JSDOM("<!doctype html><div id='editor'></div>", {
  url: ORIGIN + "/",
  pretendToBeVisual: true,
  runScripts: "outside-only",
});
Object.assign(window, { fetch: fetchAsBrowser, Headers, Request, Response, AbortController, AbortSignal });
const nowhere = { left: 0, right: 0, top: 0, bottom: 0, width: 0, height: 0 };
window.document.createRange = () => ({
  setStart() {},
  setEnd() {},
  commonAncestorContainer: window.document.body,
  getBoundingClientRect: () => nowhere,
  getClientRects: () => [],
});
window.eval(readFileSync(createRequire(import.meta.url).resolve("@zazuko/yasgui/build/yasgui.min.js"), "utf8"));

// A header of its own makes a browser ask the board before it sends anything.
const requestConfig = { endpoint, headers: { "X-Author": "editor" } };
const editor = new window.Yasgui(window.document.getElementById("editor"), { requestConfig });
const tab = editor.getTab();

/** Types a query, presses the button, and waits for what is shown. */
async function ask(text) {
  tab.getYasqe().setValue(text);
  const drawn = new Promise((resolve) => tab.getYasr().once("drawn", resolve));
  await tab.getYasqe().query().catch(() => undefined);
  await drawn;
  return tab.getYasr();
}

await ask("SELECT ?mug WHERE { ?mug a race:Mug } ORDER BY ?mug");
const table = [...window.document.querySelectorAll(".yasr table tbody tr")].map((row) => row.textContent);
const asked = (await ask("ASK { fluent:mug1 a race:Mug }")).results.getBoolean();
const mistaken = await ask("SELECT ?mug WHERE { ?mug a nowhere:Mug }");
const complaint = window.document.querySelector(".yasr .errorResult")?.textContent ?? "";
console.log(
  JSON.stringify({
    mugs: table,
    asked,
    refused: mistaken.results.getStatus(),
    complaint,
    requests,
  }),
);
process.exit(0);
