// The states of modules and connections: the sign, the tone and the word of each.

import { setBadge, toneOf } from "./state_signs.js";

const SIGN_OF = {
  "running": "ready", "waiting": "planned", "starting": "starting", "ended": "stopped", "failed": "failed", "not there": "blocked",
  "unknown": "inconclusive", "stopped": "not run", "stopping": "stopping", "connected": "ready", "apart": "not run", "no port": "planned",
};
const STOPPED = ["stopped", 0, ""];

/** State, process id and reason of a box; nothing if it stands for other programs. */
export function stateOfBox(box, status) {
  if (box.kind === "external") return null;
  return status.modules[box.tag] ?? STOPPED;
}

/** The state of a link. */
export function stateOfLink(link, status) {
  return status.connections[link.key] ?? "unknown";
}

/** The tone of a state. */
export function toneOfState(state) {
  return toneOf(SIGN_OF[state]);
}

/** Show a state in a badge. */
export function showState(element, state) {
  element.classList.add("badge");
  setBadge(element, SIGN_OF[state], state);
}
