// Announcements for screen readers: failures, questions and the end of the run, not each event.

import { h } from "./dom.js";
import { visible } from "./format.js";
import { isBad } from "./model.js";
import { stateWord, t } from "./texts.js";

const PAUSE = 2000; // milliseconds in which failures are collected into one sentence
const STALE = 10; // age in seconds beyond which an event is not announced

export class Announcer {
  constructor(page) {
    this.page = page;
    this.waiting = [];
    this.announced = new Set(); // ended attempts, and the end of the run
    this.polite = h("div", { class: "unseen", role: "status" });
    this.urgent = h("div", { class: "unseen", role: "alert" });
    this.element = h("div", {}, this.polite, this.urgent);
  }

  say(text, urgently = false) {
    (urgently ? this.urgent : this.polite).textContent = visible(text);
  }

  update(changes) {
    const { model } = this.page;
    for (const id of changes.tests) {
      const test = model.tests.get(id);
      const ended = test?.ended;
      if (!ended || !isBad(test.state) || this.announced.has(ended)) continue;
      this.announced.add(ended);
      if (this.page.now() - ended.time < STALE) this.#announce(test);
    }
    if (changes.run && model.ended && !this.announced.has(model.ended)) {
      this.announced.add(model.ended);
      if (this.page.now() - model.ended.time > STALE) return;
      this.say(t("say.end", { state: stateWord(model.ended.verdict) }));
      this.page.sound.end(!isBad(model.ended.verdict));
    }
  }

  #announce(test) {
    this.waiting.push(t("say.state", { name: test.name, state: stateWord(test.verdict) }));
    this.timer ??= setTimeout(() => this.#flush(), PAUSE);
  }

  #flush() {
    const [first, ...others] = this.waiting.splice(0);
    this.timer = undefined;
    this.say(others.length ? `${first}. ${t("say.many", { n: others.length })}` : first);
  }
}
