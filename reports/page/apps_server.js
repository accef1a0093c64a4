// Requests to the server of the page of applications.

import { takeToken } from "./data_source.js";

/** A request that was refused; the message is for the user. */
export class RefusedError extends Error {}

export class AppsServer {
  #token = takeToken();

  /** Whether this page may change anything. */
  get control() {
    return this.#token !== "";
  }

  async get(path) {
    return this.#answer(await fetch(path));
  }

  async post(path, body) {
    const headers = { "Authorization": `Bearer ${this.#token}`, "Content-Type": "application/json" };
    return this.#answer(await fetch(path, { method: "POST", headers, body: JSON.stringify(body) }));
  }

  async #answer(answer) {
    if (answer.ok) return answer.json();
    const said = await answer.json().catch(() => ({}));
    throw new RefusedError(said.error ?? `the server answers ${answer.status}`);
  }
}
