// What a running campaign shows above its report: how far it is, what is running, and the latest results.

import { AppsServer } from "./apps_server.js";
import { figureText } from "./campaign_words.js";
import { fill, free, h, setText } from "./dom.js";
import { formatRunning, formatSeconds, visible } from "./format.js";
import { badge, setBadge } from "./state_signs.js";

const PERIOD = 1000; // milliseconds between two questions to the server
const SIGN_OF_CAMPAIGN = { running: "running", stopping: "stopping", over: "passed" };
const FOUND = { failed: ["passed", "found"], passed: ["inconclusive", "missed"] }; // by a test on a faulty robot
const LIST_STATES = ["done", "running", "waiting", "killed", "broken", "lost", "refused"];

/** The live part of the page. `showReport(report)` shows a report below it. */
export class LiveCampaign {
  #server = new AppsServer();
  #reported = 0;

  constructor(showReport) {
    this.showReport = showReport;
    this.state = h("span", { class: "badge" });
    this.bar = h("progress", { "aria-label": "share of the runs that are over" });
    this.summary = h("p", { class: "number" });
    this.dashboard = h("a", { target: "_blank", rel: "noreferrer", text: "Dask's dashboard" });
    this.stop = h("button", { type: "button", on: { click: () => this.#stop() } });
    this.problem = h("p", { class: "banner", role: "alert", data: { tone: "warn" } });
    this.running = h("ul", { class: "campaign-running" });
    this.latest = h("tbody");
    this.endings = h("ul", { class: "campaign-running" });
    this.follow = h("input", { type: "checkbox", checked: true });
    this.lists = [this.running, this.endings].map((list, index) => h("div", {}, h("h3", { text: ["Running", "Without a result"][index] }), list));
    const heads = ["Result", "Test", "Robot", "Fault", "Severity", "Named first", "Time"];
    this.table = h("div", { class: "wide-table", tabindex: 0, role: "region", "aria-label": "latest results, scrolls" },
      h("table", { class: "campaign-latest", "aria-label": "latest results" }, h("thead", {}, h("tr", {}, heads.map((text) => h("th", { scope: "col", text })))), this.latest));
    this.element = h("section", { class: "chapter campaign-live" },
      h("h2", {}, "Now ", this.state), this.problem, this.bar, this.summary,
      h("div", { class: "bar" }, this.stop, this.dashboard, h("label", {}, this.follow, " keep the figures below up to date")),
      this.lists, h("h3", { text: "Latest results" }), this.table);
    for (const part of [this.problem, this.dashboard, this.stop, ...this.lists]) part.hidden = true;
  }

  async start() {
    await this.#look();
    setTimeout(() => this.start(), PERIOD);
  }

  async #look() {
    if (document.hidden) return;
    try {
      const now = await this.#server.get("progress");
      this.#show(now);
      if (now.reported !== this.#reported && (this.follow.checked || !this.#reported)) {
        this.showReport(await this.#server.get("report"));
        this.#reported = now.reported;
      }
    } catch (error) {
      this.#notify(`The campaign does not answer (${error.message}). It has ended, or was stopped; this is its last state.`);
    }
  }

  #notify(text) {
    setText(this.problem, text);
    this.problem.hidden = text === "";
  }

  #show(now) {
    this.#notify("");
    this.wanted = now.state === "stopping"; // what the button does next: drop
    document.title = visible(`Campaign ${now.name}`);
    setBadge(this.state, SIGN_OF_CAMPAIGN[now.state], now.state);
    const all = Object.values(now.counts).reduce((sum, count) => sum + count, 0);
    this.bar.max = Math.max(1, all);
    this.bar.value = all - (now.counts.waiting ?? 0) - (now.counts.running ?? 0);
    const parts = LIST_STATES.filter((state) => now.counts[state]).map((state) => `${now.counts[state]} ${state}`);
    if (now.state !== "over" && now.remaining !== null) parts.push(`about ${formatRunning(now.remaining)} left`);
    setText(this.summary, [...parts, now.workers].filter(Boolean).join(" · "));
    this.dashboard.hidden = now.dashboard === "";
    if (now.dashboard) this.dashboard.href = now.dashboard;
    this.stop.hidden = !this.#server.control || now.state === "over";
    setText(this.stop, this.wanted ? "Drop running ones" : "Begin no further run");
    const robots = Object.entries(now.robots).map(([robot, task]) => h("li", {}, h("strong", {}, free(robot)), " ", free(task)));
    const moved = new Set(Object.values(now.robots));
    const tasks = now.running.filter((task) => !moved.has(task)).map((task) => h("li", {}, free(task)));
    this.#list(0, [...robots, ...tasks]);
    this.#list(1, now.endings.map(([task, state, detail]) => h("li", {}, badge("error", state), " ", free(task), ": ", free(detail, "span", { class: "dim" }))));
    fill(this.latest, now.latest.map((one) => this.#row(one)));
  }

  #list(index, items) {
    fill([this.running, this.endings][index], items);
    this.lists[index].hidden = items.length === 0;
  }

  #row(one) {
    const [state, word] = (one.fault && FOUND[one.verdict]) || [one.verdict, one.verdict];
    const severity = one.severity === null ? "" : figureText(one.severity);
    return h("tr", {},
      h("td", {}, badge(state, word)), h("td", {}, free(one.test)), h("td", {}, free(one.robot)), h("td", {}, free(one.fault)),
      h("td", { class: "number", text: severity }), h("td", {}, free(one.named)), h("td", { class: "number", text: formatSeconds(one.seconds) }));
  }

  async #stop() {
    try {
      await this.#server.post("control/stop", { drop: this.wanted });
      await this.#look();
    } catch (error) {
      this.#notify(error.message);
    }
  }
}
