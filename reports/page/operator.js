// The operator: questions on top of every view, the dialog that stops the run, and a view in large letters.

import { fill, free, h, setText } from "./dom.js";
import { formatRunning } from "./format.js";
import { RunningTest, finished, runSign, runTone, runWords } from "./overview.js";
import { stateWord, t } from "./texts.js";

/** The oldest open question, shown on top of the view. */
export class QuestionPanel {
  constructor(page) {
    this.page = page;
    this.key = "";
    this.text = h("p", { class: "question-text", id: "question-text" });
    this.picture = h("img", { class: "question-picture", alt: t("ask.picture") });
    this.controls = h("div", { class: "question-controls" });
    this.left = h("p", { class: "question-left dim number" });
    this.bar = h("div", { class: "meter thin", "aria-hidden": "true" });
    this.said = h("p", { class: "question-said", role: "status" });
    this.more = h("p", { class: "dim" });
    this.element = h("section", { class: "question", "aria-label": t("ask.title"), data: { tone: "busy" } },
      h("div", { class: "question-words" }, this.text, this.picture), h("div", { class: "question-form" }, this.controls, this.said, this.left, this.bar, this.more));
    this.element.hidden = true;
  }

  update() {
    const { questions } = this.page.model;
    const [entry] = questions;
    const key = entry?.[0] ?? "";
    this.more.hidden = questions.size < 2;
    setText(this.more, t("ask.more", { n: questions.size - 1 }));
    if (key === this.key) return;
    this.key = key;
    this.asked = entry ? { form: "confirm", ...entry[1] } : null; // records omit default values
    this.element.hidden = !this.asked;
    if (this.asked) this.#ask(this.asked);
  }

  #ask(asked) {
    setText(this.said, "");
    fill(this.text, free(asked.text));
    this.picture.hidden = true;
    if (asked.picture) this.#show(asked);
    const without = this.page.source.withoutControl;
    const choices = asked.form === "confirm" ? [["yes", t("ask.yes")], ["no", t("ask.no")]] : asked.form === "choice" ? asked.choices.map((one) => [one, one]) : null;
    fill(this.controls, without ? h("p", { class: "dim", text: t(without) }) : choices ? this.#buttons(choices, asked) : this.#field(asked));
    this.tick();
    if (!without && this.page.idle()) this.#focus();
    this.page.say(`${t("ask.title")}: ${asked.text}`, true);
    this.page.sound.question();
  }

  /** Focus the default answer, if there is one, so that a key pressed too early does no harm. */
  #focus() {
    const first = this.asked.form === "choice" ? null : this.controls.querySelector("button, input");
    (this.controls.querySelector(".default") ?? first)?.focus();
  }

  #show(asked) {
    const path = asked.picture;
    this.page.source.file({ path, media_type: "image/png" }).then((address) => {
      if (this.asked !== asked || !address) return;
      this.picture.src = address;
      this.picture.hidden = false;
    });
  }

  #buttons(choices, asked) {
    return choices.map(([answer, word], index) => h("button", {
      type: "button", class: asked.default === answer ? "large default" : "large", "aria-describedby": "question-text",
      "aria-keyshortcuts": index < 9 ? String(index + 1) : null, on: { click: () => this.send(answer) },
    }, asked.form === "choice" && index < 9 ? h("kbd", { "aria-hidden": "true", text: String(index + 1) }) : null, h("bdi", { text: word })));
  }

  #field(asked) {
    const numeric = asked.form === "number";
    const input = h("input", {
      type: "text", inputmode: numeric ? "decimal" : null, "aria-label": t("ask.answer"), "aria-describedby": "question-text", autocomplete: "off", spellcheck: "false",
      class: numeric ? "large number" : "large grow", value: asked.default ?? "",
    });
    const submit = (event) => {
      event.preventDefault();
      const text = numeric ? input.value.trim().replace(",", ".") : input.value;
      if (numeric && (text === "" || !Number.isFinite(Number(text)))) this.#complain(t("ask.number"));
      else this.send(text);
    };
    return h("form", { class: "question-field", on: { submit } }, input, numeric && asked.unit ? free(asked.unit) : null, h("button", { type: "submit", class: "large", text: t("ask.send") }));
  }

  async send(answer) {
    const { asked } = this;
    try {
      await this.page.source.answer(asked.test, asked.question, answer);
      if (this.asked === asked) this.#notify(t("ask.sent"), "idle");
    } catch (error) {
      if (this.asked === asked) this.#complain(error.message);
    }
  }

  #complain(text) {
    this.#notify(text, "bad");
  }

  #notify(text, tone) {
    this.said.dataset.tone = tone;
    setText(this.said, text);
  }

  /** Answer a choice by its number; return whether it exists. */
  press(key) {
    if (!this.asked || this.asked.form !== "choice" || !/^[1-9]$/.test(key)) return false;
    const button = this.controls.querySelectorAll("button")[Number(key) - 1];
    button?.click();
    return Boolean(button);
  }

  tick() {
    const { asked } = this;
    if (!asked) return;
    const timeout = asked.timeout ?? 60;
    const left = asked.time + timeout - this.page.now();
    const then = asked.default === null || asked.default === undefined ? t("ask.nodefault") : t("ask.default", { answer: asked.default });
    setText(this.left, left > 0 ? `${t("ask.left", { time: formatRunning(Math.ceil(left)) })}, ${then}` : t("ask.over"));
    this.bar.style.setProperty("--part", Math.max(0, Math.min(1, left / timeout)).toFixed(3));
    this.bar.dataset.tone = left < 10 ? "warn" : "busy";
  }
}

/** The dialog that confirms a stop. */
export class StopDialog {
  constructor(page) {
    this.page = page;
    this.said = h("p", { class: "question-said", role: "status", data: { tone: "bad" } });
    const button = (key, name, act) => h("button", { type: "button", class: `large ${name}`, text: t(key), on: { click: act } });
    this.choices = h("div", { class: "dialog-choices" }, button("stop.after", "default", () => this.#stop(1)), button("stop.now", "danger", () => this.#stop(2)));
    this.text = h("p", {});
    this.element = h("dialog", { "aria-labelledby": "stop-title" }, h("h2", { id: "stop-title", text: t("stop.title") }), this.text, this.choices, this.said,
      h("div", { class: "dialog-end" }, h("button", { type: "button", class: "quiet", text: t("stop.cancel"), on: { click: () => this.element.close() } })));
  }

  open() {
    const { page } = this;
    if (page.archived || page.model.ended || this.element.open) return;
    const without = page.source.withoutControl;
    setText(this.text, t(without || "stop.text"));
    this.choices.hidden = Boolean(without);
    setText(this.said, "");
    this.element.showModal();
  }

  async #stop(stage) {
    try {
      await this.page.source.stop(stage);
      this.element.close();
    } catch (error) {
      setText(this.said, error.message);
    }
  }
}

/** The run in large letters: its verdict, the running test, the last failure. */
export class OperatorView {
  constructor(page) {
    this.page = page;
    this.sign = h("p", { class: "big-sign", "aria-hidden": "true" });
    this.title = h("p", { class: "big-title", "aria-hidden": "true" }); // the heading above has the same text
    this.counts = h("p", { class: "big-counts" });
    this.runningTest = new RunningTest(page);
    this.sound = h("input", { type: "checkbox", on: { change: () => page.sound.turn(this.sound.checked) } });
    this.sound.checked = page.sound.on;
    this.element = h("section", { class: "view big", "aria-label": t("view.operator") }, this.sign, this.title, this.counts, this.runningTest.element,
      h("p", { class: "big-options" }, h("label", {}, this.sound, ` ${t("sound")} `, h("span", { class: "dim", text: t("sound.hint") }))));
  }

  update() {
    const { model, link } = this.page;
    this.element.dataset.tone = runTone(model, link);
    setText(this.sign, runSign(model, link));
    setText(this.title, runWords(model, link));
    const words = [];
    for (const [state, count] of model.counts) if (count && state !== "planned" && state !== "running") words.push(`${count} ${stateWord(state)}`);
    setText(this.counts, finished(model) ? words.join(" · ") : "");
    const [first] = model.running;
    this.runningTest.show(first ? model.tests.get(first) : null);
  }

  tick() {
    this.runningTest.tick();
  }
}

