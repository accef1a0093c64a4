// The appearance of a state: a sign, a tone (a colour of page.css) and a word, always together.

import { h } from "./dom.js";
import { stateWord } from "./texts.js";

const SIGNS = {
  "failed": ["✗", "bad"],
  "error": ["!", "broken"],
  "fixture lost": ["↯", "broken"],
  "unexpected pass": ["≠", "bad"],
  "inconclusive": ["?", "warn"],
  "interrupted": ["■", "warn"],
  "blocked": ["⊘", "warn"],
  "flaky": ["~", "warn"],
  "not run": ["–", "idle"],
  "skipped": ["»", "idle"],
  "expected failure": ["≈", "good"],
  "measured": ["•", "good"],
  "passed": ["✓", "good"],
  "running": ["▸", "busy"],
  "planned": ["○", "idle"],
  // of measurements
  "marginal": ["△", "warn"],
  "recorded": ["•", "idle"],
  // of messages
  "debug": ["·", "idle"],
  "info": ["i", "idle"],
  "pass": ["✓", "good"],
  "warning": ["△", "warn"],
  "failure": ["✗", "bad"],
  // of fixtures
  "starting": ["▸", "busy"],
  "ready": ["✓", "good"],
  "collapsed": ["↯", "broken"],
  "stopping": ["▾", "idle"],
  "stopped": ["■", "idle"],
};

/** The sign of a state: one character. */
export function signOf(state) {
  return SIGNS[state]?.[0] ?? "·";
}

/** The tone of a state: `good`, `bad`, `broken`, `warn`, `idle` or `busy`. */
export function toneOf(state) {
  return SIGNS[state]?.[1] ?? "idle";
}

/** A coloured sign; screen readers read the word. */
export function sign(state) {
  return h("span", { class: "sign", data: { tone: toneOf(state) }, text: signOf(state), role: "img", "aria-label": stateWord(state) });
}

/** Sign and word. */
export function badge(state, word = stateWord(state)) {
  return h("span", { class: "badge", data: { tone: toneOf(state) } },
    h("span", { class: "sign", text: signOf(state), "aria-hidden": "true" }), word);
}

/** Set the state of a badge. */
export function setBadge(element, state, word = stateWord(state)) {
  if (element.dataset.state === `${state}\n${word}`) return;
  element.dataset.state = `${state}\n${word}`;
  element.dataset.tone = toneOf(state);
  element.replaceChildren(h("span", { class: "sign", text: signOf(state), "aria-hidden": "true" }), word);
}
