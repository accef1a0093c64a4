// Title and icon of the browser's tab, so that a run can be watched from another tab.

import { visible } from "./format.js";

const ICON_COLOURS = { good: "#00795a", bad: "#b83a00", broken: "#8a3380", warn: "#8a6100", idle: "#5d646f", busy: "#0067b3" };

let drawn = "";

/** Show the state of the run in the tab. */
export function showInTab(tone, mark, words, name) {
  const title = visible(`${mark} ${words}${name ? ` · ${name}` : ""}`);
  if (document.title !== title) document.title = title;
  if (drawn === tone + mark) return;
  drawn = tone + mark;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const pen = canvas.getContext("2d");
  pen.fillStyle = ICON_COLOURS[tone];
  pen.beginPath();
  pen.roundRect(0, 0, 32, 32, 7);
  pen.fill();
  pen.fillStyle = "#ffffff";
  pen.font = "bold 24px sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(mark, 16, 17);
  document.querySelector("link[rel=icon]").href = canvas.toDataURL();
}
