// A client written from docs/reference alone, with what Node has built in: asserts, ends, asks, and
// follows a live query over a broken connection.
const [base] = process.argv.slice(2);

/** One request; a problem document becomes an error that holds it. */
async function call(method, path, body, headers = {}) {
  const reply = await fetch(base + path, {
    method,
    headers: { "Content-Type": "application/json", "X-Author": "reader of the documents", ...headers },
    body: JSON.stringify(body),
  });
  const told = await reply.json();
  if (!reply.ok) throw Object.assign(new Error(told.detail), told);
  return { ...told, etag: reply.headers.get("etag") };
}

const assertFluents = (fluents, key) => call("POST", "/fluents", fluents, { "Idempotency-Key": key });
const end = (name, at, etag) => call("POST", `/fluents/${encodeURIComponent(name)}/end`, { at }, { "If-Match": etag });

async function ask(query) {
  const headers = { "Content-Type": "application/sparql-query", Accept: "application/sparql-results+json" };
  const reply = await fetch(base + "/sparql", { method: "POST", headers, body: query });
  return (await reply.json()).results.bindings;
}

/** A query's result, kept up to date: how often each solution occurs, by its text. */
class Live {
  bag = new Map();
  heard = [];
  #waiting = [];
  #delay = 100;

  constructor(query) {
    this.query = query;
    this.#connect();
  }

  #connect() {
    this.socket = new WebSocket(base.replace("http", "ws") + "/subscriptions");
    this.socket.onopen = () => {
      this.#delay = 100;
      this.socket.send(JSON.stringify({ subscribe: { id: "live", query: this.query, since: this.commit } }));
    };
    this.socket.onmessage = (event) => this.#hear(JSON.parse(event.data));
    this.socket.onclose = () => {
      if (this.isOver) return;
      this.#delay = Math.min(5000, 2 * this.#delay);
      setTimeout(() => this.#connect(), this.#delay * (0.5 + Math.random()));
    };
  }

  #hear(message) {
    this.heard.push(message.type);
    if (message.type === "snapshot") {
      this.bag.clear();
      this.#count(message.result.results.bindings, 1);
    }
    this.#count(message.removed ?? [], -1);
    this.#count(message.added ?? [], 1);
    if (message.type === "snapshot" || message.type === "delta") this.commit = message.commit;
    this.#waiting = this.#waiting.filter((isDone) => !isDone());
  }

  #count(solutions, change) {
    for (const solution of solutions) {
      const text = JSON.stringify(Object.entries(solution).sort());
      const count = (this.bag.get(text) ?? 0) + change;
      if (count) this.bag.set(text, count);
      else this.bag.delete(text);
    }
  }

  until(test) {
    return new Promise((resolve) => {
      const isDone = () => test(this) && (resolve(), true);
      if (!isDone()) this.#waiting.push(isDone);
    });
  }

  close() {
    this.isOver = true;
    this.socket.close();
  }
}

const live = new Live("SELECT ?spoon WHERE { ?spoon a race:Spoon }");
await live.until(({ heard }) => heard.includes("snapshot"));
const made = await assertFluents({ name: "spoon1", class: "Spoon", start: [1, 2] }, "first");
const again = await assertFluents({ name: "spoon1", class: "Spoon", start: [1, 2] }, "first");
await live.until(({ bag }) => bag.size === 1);
const ended = await end("spoon1", [3, 4], made.etag);
const refused = await end("spoon1", [5, 6], made.etag).catch((problem) => problem.code);
const lost = new Promise((resolve) => live.socket.addEventListener("close", resolve));
live.socket.close(); // the network fails, and the board goes on
await lost;
await assertFluents([{ name: "spoon2", class: "Spoon" }, { name: "spoon3", class: "Spoon" }], "second");
await live.until(({ bag }) => bag.size === 3);
const fresh = await ask(live.query);
live.close();
console.log(
  JSON.stringify({
    repeated: again.commit === made.commit,
    finish: ended.fluent.finish,
    refused,
    heard: live.heard,
    fresh: fresh.length,
  }),
);
