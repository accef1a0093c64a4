// The source of the page's data: the live server, or the blocks of an archived page, with the same interface.
//
// A source has `facts`, `start(take, report)` (`take` gets records, `report` the state of the connection: `connecting`,
// `live`, `reconnecting`, `complete`), `series(path)`, `file(record)`, `compare()`, `history()`, and, if it has
// control, `stop(stage)` and `answer(…)`.

const TOKEN_KEY = "rtf-token";
const RETRY = 2000; // milliseconds before a refused stream is requested again
const SLICE = 4000; // records of an archive that are read between two frames

/** Return the source of this page. */
export async function openSource() {
  if (document.getElementById("rtf-journal")) return ArchiveSource.open();
  return LiveSource.open();
}

/** Remove the token from the address, so that it is neither visible nor bookmarked, and store it for this tab. */
export function takeToken() {
  const found = /(?:^#|&)token=([^&]*)/.exec(location.hash);
  try {
    if (found) sessionStorage.setItem(TOKEN_KEY, found[1]);
    if (found) history.replaceState(null, "", location.pathname + location.search);
    return sessionStorage.getItem(TOKEN_KEY) ?? "";
  } catch {
    return found?.[1] ?? ""; // a browser without storage: the token lasts until the page is reloaded
  }
}

function relativeAddress(folder, path) {
  return `${folder}/${path.toWellFormed().split("/").map((part) => encodeURIComponent(part)).join("/")}`;
}

async function fetched(address, options) {
  const answer = await fetch(address, options);
  if (!answer.ok) throw new Error(`${address}: the server answers ${answer.status}`);
  return answer;
}

/** Columns of a series: {columns: [Float64Array, …], rows, thinned}, the axis first. */
export function readSeries(buffer) {
  const view = new DataView(buffer);
  const [width, rows, thinned] = [0, 4, 8].map((offset) => view.getUint32(offset, true));
  const columns = [];
  for (let column = 0; column < width; column += 1) {
    const values = new Float64Array(rows);
    for (let row = 0; row < rows; row += 1) values[row] = view.getFloat64(12 + 8 * (column * rows + row), true);
    columns.push(values);
  }
  return { columns, rows, thinned: thinned === 1 };
}

class LiveSource {
  #token = takeToken();
  #last = 0; // number of received lines of the journal

  constructor(facts) {
    this.facts = facts;
  }

  static async open() {
    return new LiveSource(await (await fetched("facts")).json());
  }

  /** The reason why this page cannot control the run: a key of the texts, or empty. */
  get withoutControl() {
    if (!this.facts.control) return "control.off";
    return this.#token ? "" : "control.token";
  }

  start(take, report) {
    report("connecting");
    const stream = new EventSource(`events?after=${this.#last}`);
    stream.addEventListener("open", () => report("live"));
    // The next run may be served at the same address: then the page has to be reloaded.
    stream.addEventListener("run", (message) => JSON.parse(message.data) === this.facts.run || location.reload());
    stream.addEventListener("message", (message) => {
      const records = JSON.parse(message.data);
      const total = Number(message.lastEventId);
      const known = this.#last - (total - records.length); // sent again after a reconnection
      if (total <= this.#last) return;
      this.#last = total;
      take(known > 0 ? records.slice(known) : records);
    });
    stream.addEventListener("end", () => {
      stream.close();
      report("complete");
    });
    stream.addEventListener("error", () => {
      report("reconnecting");
      if (stream.readyState !== EventSource.CLOSED) return; // the browser tries again by itself
      setTimeout(() => this.start(take, report), RETRY);
    });
    this.stopListening = () => stream.close();
  }

  async series(path) {
    return readSeries(await (await fetched(relativeAddress("series", path))).arrayBuffer());
  }

  /** The address of an attached file, or null if the page does not have it. */
  async file(record) {
    return relativeAddress("files", record.path);
  }

  async compare() {
    return this.facts.compare ? (await fetched("compare")).json() : null;
  }

  async history() {
    return this.facts.history ? (await fetched("history")).json() : null;
  }

  stop(stage) {
    return this.#control("stop", { stage });
  }

  answer(test, question, answer) {
    return this.#control("answer", { test, question, answer });
  }

  /** Send a request to the server; throws an Error with a message for the operator. */
  async #control(what, body) {
    const answer = await fetch(`control/${what}`, {
      method: "POST",
      headers: { "Authorization": `Bearer ${this.#token}`, "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    if (answer.ok) return;
    const said = await answer.json().catch(() => ({}));
    throw new Error(said.error ?? `the server answers ${answer.status}`);
  }
}

async function unpack(element) {
  const text = atob(element.textContent);
  const packed = new Uint8Array(text.length);
  for (let index = 0; index < text.length; index += 1) packed[index] = text.charCodeAt(index);
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
}

/** The data of a block of a page that is one file; null if there is no such block. */
export async function blockJson(id) {
  const element = document.getElementById(id);
  return element ? (await unpack(element)).json() : null;
}

const nextTask = () => new Promise((resolve) => setTimeout(resolve));

class ArchiveSource {
  #files = new Map();
  unreadable = 0;

  constructor(facts) {
    this.facts = facts;
  }

  static async open() {
    return new ArchiveSource(await blockJson("rtf-facts") ?? { mode: "archive" });
  }

  get withoutControl() {
    return "control.archive";
  }

  async start(take, report) {
    report("connecting");
    const text = await (await unpack(document.getElementById("rtf-journal"))).text();
    let records = [];
    for (let start = 0; start < text.length;) {
      const newline = text.indexOf("\n", start);
      if (newline < 0) break; // an incomplete last line
      this.#read(text.slice(start, newline), records);
      start = newline + 1;
      if (records.length < SLICE) continue;
      take(records);
      records = [];
      await nextTask();
    }
    take(records);
    report("complete");
  }

  #read(line, records) {
    try {
      records.push(JSON.parse(line));
    } catch {
      this.unreadable += 1; // the page shows the number
    }
  }

  stopListening() {}

  async series(path) {
    const element = this.#block("series", path);
    if (!element) throw new Error(`${path} is not in this file`);
    return readSeries(await (await unpack(element)).arrayBuffer());
  }

  async file(record) {
    const element = this.#block("file", record.path);
    if (!element) return null;
    if (!this.#files.has(record.path)) {
      const bytes = await (await unpack(element)).arrayBuffer();
      // Only types for <img> are kept: no other file may be opened as a page.
      const type = record.media_type?.startsWith("image/") ? record.media_type : "application/octet-stream";
      this.#files.set(record.path, URL.createObjectURL(new Blob([bytes], { type })));
    }
    return this.#files.get(record.path);
  }

  compare() {
    return blockJson("rtf-compare");
  }

  history() {
    return blockJson("rtf-history");
  }

  #block(kind, path) {
    return document.querySelector(`script[data-${kind}="${CSS.escape(path)}"]`);
  }
}
