// A window on a log: some thousand records of a file that may have millions, and the requests that move it.
//
// `items` are all wanted records with numbers above `low`, up to `high`. The server looks through a limited part of the
// log at once, so a request may bring nothing and yet move an edge: a caller that wants more asks again.

const STEP = 500; // records of a request
const MOST = 5000; // records that are kept; beyond it those at the other end are dropped

/** A request that is not answered as it should be. The message is the server's; `refused`: the request was wrong. */
export class LogRequestError extends Error {
  constructor(text, refused) {
    super(text);
    this.refused = refused;
  }
}

/** Ask the server for JSON. Raises LogRequestError. */
export async function askServer(path, signal) {
  const answer = await fetch(path, { signal });
  if (answer.ok) return answer.json();
  throw new LogRequestError((await answer.text()).trim(), answer.status === 400);
}

export class LogWindow {
  constructor() {
    this.reset({});
  }

  /** Begin anew with other filters; what is being asked is forgotten. */
  reset(filters) {
    this.stop?.abort();
    this.stop = new AbortController();
    Object.assign(this, { filters, items: [], loaded: false, low: 0, high: 0, oldest: 1, newest: 0 });
  }

  /** Whether there may be wanted records before, or after, those in the window. */
  get hasOlder() {
    return this.loaded && this.low >= this.oldest;
  }

  get hasNewer() {
    return this.loaded && this.high < this.newest;
  }

  /** Show the end, or the beginning, of the log. */
  async showEnd() {
    this.#replace(await this.#ask({ side: "newest" }));
  }

  async showBeginning() {
    this.#replace(await this.#ask({ side: "oldest" }));
  }

  /** Add records before the window; return how many. */
  async addOlder() {
    const got = await this.#ask({ side: "newest", high: this.low });
    this.low = got.low;
    this.items = [...got.records, ...this.items];
    if (this.items.length > MOST) {
      this.high = this.items[MOST].number - 1;
      this.items.length = MOST;
    }
    return got.records.length;
  }

  /** Add records behind the window. */
  async addNewer() {
    this.#append(await this.#ask({ side: "oldest", low: this.high }));
  }

  /** Go on to the newest records. Where more came than a request brings, the window begins with those. */
  async follow() {
    const before = this.high;
    const got = await this.#ask({ side: "newest", low: before });
    if (got.newest < before) await this.showEnd(); // the file is another one
    else if (got.low > before) this.#replace(got);
    else this.#append(got);
  }

  #replace(got) {
    Object.assign(this, { items: got.records, low: got.low, high: got.high, loaded: true });
  }

  #append(got) {
    this.high = Math.max(this.high, got.high);
    if (!got.records.length) return;
    this.items = [...this.items, ...got.records];
    const extra = this.items.length - MOST;
    if (extra > 0) {
      this.low = this.items[extra - 1].number;
      this.items = this.items.slice(extra);
    }
  }

  async #ask(range) {
    const words = new URLSearchParams({ ...this.filters, ...range, count: STEP });
    const { signal } = this.stop;
    const got = await askServer(`records?${words}`, signal);
    signal.throwIfAborted();
    this.oldest = got.oldest;
    this.newest = got.newest;
    return got;
  }
}
