// The review queue: the integrations in the server's order, the one that most needs a person first.

import { byId, fill, h, icon, set, setIcon, text } from "./dom.js";
import { count, measured, metres, pair, whole } from "./format.js";
import { off } from "./graph.js";
import { VirtualList } from "./virtual.js";

const HEIGHT = 34;
const TELL = 150;
const STATES = {
  pending: { label: "to decide", icon: "open" },
  accepted: { label: "accepted", icon: "check" },
  rejected: { label: "rejected", icon: "close" },
  none: { label: "no transformation found", icon: "none" },
  failed: { label: "matching failed", icon: "alert" },
  matching: { label: "being matched", icon: "waiting" },
};
const FILTERS = [
  ["all", "All", () => true],
  ["pending", "Open", (row) => row.state === "pending"],
  ["later", "Later", (row) => row.later],
  ["accepted", "Accepted", (row) => row.state === "accepted"],
  ["rejected", "Rejected", (row) => row.state === "rejected"],
  ["loops", "Loops", (row) => row.kind !== "neighbour"],
  ["silenced", "Silenced", (row) => row.silenced],
  ["nudged", "By hand", (row) => row.origin === "nudged"],
  ["none", "None", (row) => row.state === "none" || row.state === "failed"],
];

const KINDS = { closure: "loop closure", imported: "imported", manual: "by hand", neighbour: "" };
const ORDERS = {
  doubt: null,
  quantity: (a, b, project) => (project.quantity(a) ?? Infinity) - (project.quantity(b) ?? Infinity),
  contradicted: (a, b) => (b.contradicted ?? -1) - (a.contradicted ?? -1),
  residual: (a, b) => (b.residual ?? -1) - (a.residual ?? -1),
  scans: (a, b) => compare(scans(a), scans(b)),
};

export const stateLabel = (state) => STATES[state]?.label ?? state;
export const stateIcon = (state) => STATES[state]?.icon ?? "none";

export class Queue {
  #filter = "all";
  #search = "";
  #order = "doubt";
  #flips = { passes: new Set(), fails: new Set() };
  #shown = [];
  #scale = 1;
  #threshold = 0;

  constructor(project, view, enter) {
    Object.assign(this, { project, view, enter });
    this.box = byId("queue");
    this.list = new VirtualList(this.box, { height: HEIGHT, make: makeRow, draw: (element, row) => this.#draw(element, row), key: (row) => row.id });
    this.#controls();
    view.addEventListener("opened", () => ((this.#told = null), this.#tellOrder()));
    for (const event of ["pointerdown", "keydown", "wheel"]) addEventListener(event, () => (this.#touched = true), { once: true, capture: true });
    project.addEventListener("rows", () => (this.refresh(), this.#begin()));
    project.addEventListener("info", () => project.info.threshold === this.#threshold || this.refresh());
    view.addEventListener("changed", () => this.#follow());
  }

  /** The rows the filter and the search let through, in queue order. */
  get rows() {
    return this.#shown;
  }

  /** Draw the rows again after they, the filter or the search changed. */
  refresh() {
    const test = FILTERS.find(([name]) => name === this.#filter)[2];
    this.#shown = this.project.rows.filter((row) => test(row) && found(row, this.#search));
    const order = ORDERS[this.#order];
    if (order) this.#shown.sort((a, b) => order(a, b, this.project));
    this.#threshold = this.project.info?.threshold ?? 0;
    this.#scale = this.project.criterion.maximum ?? scale(this.project, this.#threshold);
    this.list.show(this.#shown, this.view.integration);
    this.#chips();
    this.#needs();
    this.#empty();
    this.#mark();
    this.#tellOrder();
  }

  /** The scene steps through what is listed here too: tell the view, where that is not simply the whole queue. */
  #tellOrder() {
    const whole = this.#filter === "all" && !this.#search && this.#order === "doubt";
    const ids = whole ? null : this.#shown.map((row) => row.id);
    const words = JSON.stringify(ids);
    clearTimeout(this.#telling);
    if (words === this.#told || this.view.id === null) return;
    const tell = () => ((this.#told = words), this.view.act("set_order", ids).catch((error) => this.project.tell("trouble", error)));
    this.#telling = setTimeout(tell, TELL);
  }

  /** Matching is over and nobody has touched anything: begin with what has turned out to be the most doubtful. */
  #begin() {
    if (this.#begun || this.#touched || this.project.rows.some((row) => row.state === "matching")) return;
    this.#begun = true;
    const first = this.project.rows[0];
    if (first && this.view.integration && !this.linked && this.view.integration !== first.id) this.select(first.id);
  }

  #told = null;
  #telling = 0;
  #touched = false;
  #begun = false;
  /** Whether the address named an integration: then that is looked at. */
  linked = location.hash.length > 1;

  /** Mark the rows another threshold would flip. */
  preview(flips) {
    this.#flips = flips;
    this.list.show(this.#shown, this.view.integration);
  }

  /** Select the row `steps` further down, at most the last; where the selection is filtered out, the first. */
  step(steps) {
    const at = this.#at;
    const wanted = at < 0 ? 0 : Math.min(this.#shown.length - 1, Math.max(0, at + steps));
    if (this.#shown[wanted]) this.select(this.#shown[wanted].id);
  }

  /** Select the next or previous row; after the last comes the first. */
  turn(step) {
    const [at, length] = [this.#at, this.#shown.length];
    if (length) this.select(this.#shown[at < 0 ? 0 : (at + step + length) % length].id);
  }

  get #at() {
    return this.#shown.findIndex((row) => row.id === this.view.integration);
  }

  select(id) {
    this.view.select(id);
    this.list.reveal(id);
  }

  #controls() {
    byId("search").addEventListener("input", (event) => this.#find(event.target.value));
    byId("order").addEventListener("change", (event) => ((this.#order = event.target.value), this.refresh()));
    this.box.addEventListener("keydown", (event) => this.#key(event));
    this.box.addEventListener("scroll", () => this.#point(), { passive: true });
    this.box.addEventListener("click", (event) => {
      const row = event.target.closest("[role=option]");
      if (row) this.select(row.dataset.id);
    });
    fill(byId("filters"), FILTERS.map(([name, label]) => this.#chip(name, label)));
  }

  #chip(name, label) {
    const choose = () => {
      this.#filter = name;
      this.refresh();
    };
    const number = h("span.number");
    return h("button.chip", { type: "button", "data-filter": name, onclick: choose }, label, " ", number);
  }

  #chips() {
    for (const chip of byId("filters").children) {
      const [name, , test] = FILTERS.find(([filter]) => filter === chip.dataset.filter);
      set(chip, "aria-pressed", String(name === this.#filter));
      const number = this.project.rows.filter(test).length;
      chip.hidden = number === 0 && RARE.has(name) && name !== this.#filter;
      text(chip.lastElementChild, whole(number));
    }
  }

  #needs() {
    const { rows, undecided } = this.project;
    const doubtful = undecided.filter((row) => row.verdict === "review");
    const need = rows.some((row) => row.verdict === "review") ? doubtful : undecided;
    const open = undecided.length > 0 || rows.some((row) => row.state === "matching");
    text(byId("need"), open ? `${whole(need.length)} need${need.length === 1 ? "s" : ""} you` : rows.length ? "Everything is decided" : "");
  }

  #find(words) {
    this.#search = words.trim().toLowerCase();
    this.refresh();
    this.list.reveal(this.view.integration);
  }

  #empty() {
    const note = byId("queue-empty");
    note.hidden = this.#shown.length > 0;
    text(note, this.project.rows.length ? "No integration passes this filter." : nothing(this.project.info));
  }

  #key(event) {
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: this.list.fits, PageUp: -this.list.fits, Home: -Infinity, End: Infinity }[event.key];
    if (event.key === "Enter") this.enter();
    else if (steps) this.step(steps);
    else return;
    event.preventDefault();
  }

  #follow() {
    if (this.view.integration !== this.#followed) this.list.reveal(this.view.integration);
    this.#followed = this.view.integration;
    this.#mark();
  }

  #followed = null;

  #mark() {
    for (const element of this.list.canvas.children) {
      set(element, "aria-selected", String(!element.hidden && element.dataset.id === this.view.integration));
    }
    this.#point();
  }

  /** Point at the selected row; where it is scrolled out of sight it is not there to be pointed at. */
  #point() {
    const rows = [...this.list.canvas.children];
    const active = rows.find((element) => !element.hidden && element.dataset.id === this.view.integration);
    set(this.box, "aria-activedescendant", active?.id ?? null);
  }

  #draw(element, row) {
    const [state, id, bar, value, seen, note] = element.children;
    Object.assign(element.dataset, { id: row.id, state: row.state, verdict: row.verdict ?? "", kind: row.kind });
    element.title = hint(row);
    element.id = `row-${row.id}`;
    setIcon(state.firstElementChild, stateIcon(row.state));
    text(state.lastElementChild, stateLabel(row.state));
    text(id, pair(row.id));
    const quantity = row.state === "none" ? null : this.project.quantity(row);
    drawBar(bar, quantity, this.#scale, this.#threshold);
    text(value, quantity === null ? "" : measured(quantity, this.project.criterion.unit));
    drawEvidence(seen, row);
    this.#note(note, row);
    set(element, "aria-selected", String(row.id === this.view.integration));
  }

  #note(note, row) {
    const flip = this.#flips.passes.has(row.id) ? "would pass" : this.#flips.fails.has(row.id) ? "would fail" : "";
    const graph = row.silenced ? "silenced" : "";
    note.className = flip ? `note ${flip.replace(" ", "-")}` : `note ${graph}`;
    text(note, flip || graph || (row.state === "pending" ? (row.later ? "later" : PROPOSALS[row.verdict]) : SHORT[row.state]) || row.who || row.heuristic);
  }
}

const RARE = new Set(["none", "loops", "silenced", "later", "nudged"]);
const PROPOSALS = { accepted: "→ accept", review: "→ look", rejected: "→ reject" };
const SHORT = { none: "none found", failed: "failed", matching: "matching" };

function makeRow() {
  const state = h("span.state", {}, icon("open"), h("span.only-read"));
  const bar = h("span.bar", { "aria-hidden": "true" }, h("i.fill"), h("i.limit"));
  const seen = h("span.seen", {}, h("i.supported", { "aria-hidden": "true" }), h("i.contradicted", { "aria-hidden": "true" }), h("span.only-read"));
  return h("div.item", { role: "option" }, state, h("span.pair"), bar, h("span.value"), seen, h("span.note"));
}

/** What both scans see against what one denies of the other, as shares of a bar. */
function drawEvidence(seen, { supported, contradicted }) {
  const known = supported !== null && supported !== undefined;
  const all = known ? supported + contradicted || 1 : 1;
  seen.children[0].style.width = known ? `${(100 * supported) / all}%` : "0";
  seen.children[1].style.width = known ? `${(100 * contradicted) / all}%` : "0";
  text(seen.lastElementChild, known ? told(supported, contradicted) : "");
}

const told = (supported, contradicted) => `${metres(supported, 1)} seen by both, ${metres(contradicted, 1)} contradicted`;

function hint(row) {
  const by = row.who ? `${stateLabel(row.state)} by ${row.who}` : "";
  const graph = row.residual === null ? "" : `${off(row.residual, row.turn)} off the graph`;
  const seen = row.supported === null ? "" : told(row.supported, row.contradicted);
  const hand = row.origin === "nudged" ? "laid by hand" : "";
  return [KINDS[row.kind], hand, by, seen, graph, row.reason].filter(Boolean).join(", ");
}

function drawBar(bar, quantity, scale, threshold) {
  bar.hidden = quantity === null;
  const share = Math.min(1, (quantity ?? 0) / scale);
  bar.firstElementChild.style.width = `${100 * share}%`;
  bar.lastElementChild.style.left = `${100 * Math.min(1, threshold / scale)}%`;
}

/** What stands at the right end of the bars: all but the highest few numbers fit. */
function scale(project, threshold) {
  const values = project.rows.map((row) => project.quantity(row) ?? 0).sort((a, b) => a - b);
  return Math.max(2 * threshold, values[Math.floor(0.95 * (values.length - 1))] ?? 0, 0.01);
}

function found(row, words) {
  const told = [row.id, pair(row.id), row.heuristic, row.who, row.reason, KINDS[row.kind], stateLabel(row.state)];
  return !words || told.some((part) => part?.toLowerCase().includes(words));
}

function scans(row) {
  return row.id.split(/[.-]/).map(Number);
}

function compare(a, b) {
  const at = a.findIndex((number, place) => number !== b[place]);
  return at < 0 ? 0 : a[at] - b[at];
}

function nothing(info) {
  const scans = info ? info.logs.reduce((sum, log) => sum + log.scans, 0) : 0;
  if (scans === 0) return "The logs of this project hold no scans, so there is nothing to integrate.";
  return `${count(scans, "scan")} cannot make a pair: integrations need two consecutive scans of one log.`;
}
