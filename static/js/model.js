// What the page knows of its project: a mirror of the server, refreshed when the server says that something changed.

import { get, post } from "./api.js";

const MATCHING_PAUSE = 700;
const MERGING_PAUSE = 500;
const REDRAW_PAUSE = 250;
const DECISION_PAUSE = 60;

const VALUE = { parameter: "value_threshold", quantity: "value", unit: "m", maximum: null, step: 0.05 };

/** Tells "info", "rows", "progress", "match", "graph", "search", "searched", "map", "parameters", "decided", "deleted" and "trouble" as events. */
export class Project extends EventTarget {
  #said = false;
  #tag = "";
  /** Rows as they were loaded, of those that events have written into since. */
  #original = new Map();

  constructor(id) {
    super();
    this.id = id;
    this.url = `/api/projects/${encodeURIComponent(id)}`;
    this.info = null;
    this.rows = [];
    this.index = new Map();
    this.refreshInfo = coalesced(() => this.#loadInfo(), (error) => this.tell("trouble", error));
    this.refreshRows = coalesced(() => this.#loadRows(), (error) => this.tell("trouble", error));
    this.redraw = coalesced(async () => this.tell("rows"));
  }

  load() {
    return Promise.all([this.#loadInfo(), this.#loadRows()]);
  }

  refresh(pause = DECISION_PAUSE) {
    this.refreshInfo(pause);
    this.refreshRows(pause);
  }

  row(id) {
    return this.index.get(id) ?? null;
  }

  /** The rows a person can decide. */
  get undecided() {
    return this.rows.filter((row) => row.state === "pending");
  }

  /** What the threshold is about: the value in metres, or the confidence. */
  get criterion() {
    return this.info?.criterion ?? VALUE;
  }

  /** The number of a row that the threshold is about; null where it is not known. */
  quantity(row) {
    return row[this.criterion.quantity] ?? null;
  }

  detail(id, heuristic, signal) {
    const query = heuristic ? `?heuristic=${encodeURIComponent(heuristic)}` : "";
    return get(`${this.url}/integrations/${encodeURIComponent(id)}${query}`, { signal });
  }

  flips(value, signal) {
    return get(`${this.url}/threshold?value=${value}`, { signal });
  }

  decide(integrations, verdict) {
    return this.#change("decisions", { integrations, verdict, expected_revision: this.info.revision });
  }

  undo() {
    return this.#change("undo");
  }

  setParameters(body) {
    return this.#change("parameters", body);
  }

  async matching(action) {
    await post(`${this.url}/matching`, { action });
    this.refreshInfo();
  }

  preview(url, signal) {
    return get(url, { signal });
  }

  /** Search for loop closures, or stop the search. */
  async search(action) {
    this.#said &&= action !== "start";
    this.#searched(await post(`${this.url}/loops`, { action }));
  }

  /** Put pairs of scans into the queue. */
  addPairs(integrations) {
    return post(`${this.url}/pairs`, { integrations });
  }

  /** Take in one event of the server. */
  hear(event) {
    if (event.type === "match") this.#matched(event);
    else if (event.type === "progress") this.#progressed(event);
    else if (event.type === "parameters") this.refresh(), this.tell("parameters", event.revision ?? 0);
    else if (event.type === "decision") this.#decided(event);
    else if (event.type === "later") this.#put(event.rows), this.redraw(0), this.refreshRows();
    else if (event.type === "hello" || event.type === "log") this.refresh();
    else if (event.type === "graph") this.refresh(), this.tell("graph");
    else if (event.type === "search") this.#searched(event);
    else if (event.type === "project") this.refreshInfo();
    else if (event.type === "deleted") this.#end();
    else if (event.type === "map") this.refreshInfo(), this.tell("map");
    else if (event.type === "error") this.tell("trouble", new Error(event.message));
  }

  tell(type, detail = null) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  /** The project was deleted: ask for nothing more. */
  #end() {
    for (const name of ["refreshInfo", "refreshRows"]) {
      this[name].stop();
      this[name] = () => {};
    }
    this.tell("deleted");
  }

  async #change(what, body) {
    try {
      const change = await post(`${this.url}/${what}`, body);
      this.info.revision = change.revision ?? this.info.revision;
      return change;
    } finally {
      this.refresh();
    }
  }

  async #loadInfo() {
    const before = this.info?.search.running;
    this.info = await get(this.url);
    if (before) this.#searchEnded();
    this.tell("info");
    this.tell("progress");
    this.tell("search");
    if (this.info.merging) this.refreshInfo(MERGING_PAUSE);
  }

  async #loadRows() {
    const answer = await get(`${this.url}/integrations${this.#tag ? `?since=${this.#tag}` : ""}`);
    this.rows = answer.since === null ? answer.integrations : this.#patched(answer);
    this.index = new Map(this.rows.map((row) => [row.id, row]));
    this.#tag = answer.tag;
    this.#original.clear();
    this.tell("rows");
  }

  /** The rows with what changed since they were loaded; what events wrote into the others meanwhile is taken back. */
  #patched({ integrations, places, gone }) {
    for (const [id, row] of this.#original) Object.assign(this.index.get(id), row);
    const out = new Set([...gone, ...integrations.map((row) => row.id)]);
    const rows = [];
    let next = 0;
    const put = () => {
      while (places[next] === rows.length) rows.push(integrations[next++]);
    };
    for (const row of this.rows) {
      if (out.has(row.id)) continue;
      put();
      rows.push(row);
    }
    put();
    return rows;
  }

  /** A match was found: show it in its place at once, and the new order when there is time. */
  #matched(event) {
    this.#put(event.row ? [event.row] : []);
    this.redraw(REDRAW_PAUSE);
    this.refresh(MATCHING_PAUSE);
    this.tell("match", event);
  }

  #decided({ rows = [], integrations = [], revision, undo, redo }) {
    Object.assign(this.info, { revision, undo, redo });
    this.tell("info");
    this.#put(rows);
    this.redraw(0);
    this.tell("decided", integrations);
    this.refresh();
  }

  /** Newer rows, each in the place it has. */
  #put(rows) {
    for (const row of rows) {
      const held = this.index.get(row.id);
      if (held && !this.#original.has(row.id)) this.#original.set(row.id, { ...held });
      Object.assign(held ?? {}, row);
    }
  }

  /** How far the search is; its last word is told once. */
  #searched(event) {
    if (!this.info) return;
    const { running } = this.info.search;
    const { done, total, message } = event;
    this.info.search = { running: event.running, done, total, message };
    this.tell("search");
    if (running) this.#searchEnded();
  }

  /** Events and answers may cross: the end of a search is told once. */
  #searchEnded() {
    const { running, message } = this.info.search;
    if (running || this.#said) return;
    this.#said = true;
    this.tell("searched", message);
    this.refresh();
  }

  #progressed(event) {
    if (!this.info) return;
    Object.assign(this.info.progress, event);
    this.tell("progress");
  }
}

/** Run `work` soon, but never twice at the same time and not again before a pause; calls in between become one. */
function coalesced(work, failed = () => {}) {
  let [timer, busy, finished, pause] = [0, false, -Infinity, Infinity];
  const run = async () => {
    [busy, pause] = [true, Infinity];
    await work().catch(failed);
    [busy, finished] = [false, performance.now()];
    schedule();
  };
  const schedule = () => {
    clearTimeout(timer);
    if (!busy && pause < Infinity) timer = setTimeout(run, Math.max(0, finished + pause - performance.now()));
  };
  const ask = (asked = DECISION_PAUSE) => {
    pause = Math.min(pause, asked);
    schedule();
  };
  ask.stop = () => {
    pause = Infinity;
    clearTimeout(timer);
  };
  return ask;
}
