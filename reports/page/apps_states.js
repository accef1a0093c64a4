// The states of modules and connections: the sign, the tone and the word of each.

import { setBadge, toneOf } from "./state_signs.js";

const SIGN_OF = {
  "running": "ready", "waiting": "planned", "starting": "starting", "ended": "stopped", "failed": "failed", "not there": "blocked",
  "unknown": "inconclusive", "stopped": "not run", "stopping": "stopping", "connected": "ready", "apart": "not run", "no port": "planned",
};

/** State, process id, reason and node of a box; nothing if it stands for other programs. */
export function stateOfBox(box, status) {
  if (box.kind === "external") return null;
  return status.modules[box.tag] ?? ["stopped", 0, "", box.node];
}

/** The rate of a link as a text; empty where it is not counted. */
export function rateOfLink(link, status) {
  const found = status.rates[link.key];
  if (!found) return "";
  const size = `${(found.bytes / 1024).toFixed(1)} KiB/s`;
  const text = found.messages === null ? size : `${found.messages.toFixed(1)} /s, ${size}`;
  return found.shared > 1 ? `${text} of ${found.shared} together` : text;
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
