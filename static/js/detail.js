// The selected integration: what was found, by which heuristic, and why. Feeds the candidate and heuristics tables.

import { byId, fill, h, icon, setIcon, text } from "./dom.js";
import { measured, pair } from "./format.js";
import { off } from "./graph.js";
import { stateIcon, stateLabel } from "./queue.js";

const PATIENCE = 300;

export class Detail {
  #loading = null;
  #shown = "";

  /** `panels` have show(detail, view) and mark(view). */
  constructor(project, view, panels) {
    Object.assign(this, { project, view, panels });
    view.addEventListener("changed", () => this.#follow());
    project.addEventListener("match", ({ detail }) => this.#shown && detail.integration === view.integration && this.#again());
    project.addEventListener("parameters", ({ detail }) => this.#forget(detail));
    project.addEventListener("graph", () => this.#shown && this.#again());
    project.addEventListener("decided", ({ detail }) => this.#shown && detail.includes(view.integration) && this.#again());
    project.addEventListener("rows", () => this.#head());
  }

  /** Something about the selection has changed: the view knows by what it is looked at now, another mode may have come. */
  #again() {
    return this.load(this.view.id !== null);
  }

  /** Fetch what is known of the selection; an answer to an earlier selection is dropped. */
  async load(asViewed = Boolean(this.view.snapshot.trial)) {
    this.#loading?.abort();
    this.#loading = new AbortController();
    const { integration, snapshot, project } = this.view;
    if (!integration) return;
    const signal = this.#loading.signal;
    try {
      const detail = await (asViewed ? this.view.detail(signal) : project.detail(integration, snapshot.heuristic, signal));
      if (detail.row.id !== this.view.integration) return;
      for (const panel of this.panels) panel.show(detail, this.view);
      this.#reasons(detail);
    } catch (error) {
      if (error.name !== "AbortError") project.tell("trouble", error);
    }
  }

  /** Another mode may not know this heuristic: load again once the view has said what it shows now. */
  #forget(revision) {
    this.#shown = "";
    this.#since = revision;
    setTimeout(() => this.#shown === "" && this.view.check().catch((error) => this.project.tell("trouble", error)), PATIENCE);
  }

  #since = 0;

  #follow() {
    const { integration, snapshot } = this.view;
    if ((snapshot.revision ?? 0) < this.#since) return;
    const wanted = `${integration} ${snapshot.heuristic ?? ""} ${snapshot.trial?.number ?? ""}`;
    this.#head();
    if (wanted === this.#shown) for (const panel of this.panels) panel.mark(this.view);
    else this.load();
    this.#shown = wanted;
  }

  #head() {
    const row = this.project.row(this.view.integration);
    byId("detail").hidden = row === null;
    if (!row) return;
    text(byId("detail-pair"), pair(row.id));
    Object.assign(byId("detail-state").dataset, { state: row.state, verdict: row.verdict ?? "" });
    setIcon(byId("detail-state").firstElementChild, stateIcon(row.state));
    text(byId("detail-state").lastElementChild, this.#decided(row));
    this.#clearing(row);
  }

  #decided(row) {
    const { quantity, unit } = this.project.criterion;
    const number = this.project.quantity(row);
    const said = number === null || row.state === "none" ? "" : unit ? `, ${measured(number, unit)}` : `, ${quantity} ${measured(number, unit)}`;
    const graph = row.residual === null || row.state === "none" ? "" : `, ${off(row.residual, row.turn)} off the graph`;
    return `${stateLabel(row.state)}${row.who ? ` by ${row.who}` : ""}${said}${graph}`;
  }

  #clearing(row) {
    const button = byId("detail-clear");
    button.hidden = row.state !== "accepted" && row.state !== "rejected";
    button.onclick = () => this.view.decideMany([row.id], "undecided").catch((error) => this.project.tell("trouble", error));
  }

  #reasons({ row, match }) {
    const reasons = match?.reasons ?? (row.state === "failed" ? [row.reason] : ["This pair is being matched; it goes before the others."]);
    fill(byId("detail-reasons"), reasons.map((reason) => h("li", {}, reason)), decisionReason(row));
  }
}

/** Fill the place of the state with an icon and a text to be set later. */
export function prepare(element) {
  fill(element, icon("open"), h("span"));
}

function decisionReason(row) {
  const decided = row.state === "accepted" || row.state === "rejected";
  return decided && row.reason ? h("li", {}, `Reason given: ${row.reason}`) : null;
}
