// Why a candidate has its value: chains and pairs of segments, and what lines of sight deny. Marked in step with the scene.

import { byId, fill, h, set, text } from "./dom.js";
import { count, fixed, metres } from "./format.js";

const PAUSE = 80;
const KINDS = { supported: "seen by both", contradicted: "denied by lines of sight", shadowed: "in a shadow", unseen: "unseen" };

export class Why {
  #wanted = "";
  #timer = 0;
  #loading = null;

  constructor(view) {
    this.view = view;
    this.panel = byId("panel-why");
    this.panel.addEventListener("click", (event) => this.#choose(event.target.closest("button")));
    new MutationObserver(() => this.mark(view)).observe(this.panel, { attributeFilter: ["hidden"] });
  }

  show() {
    this.#wanted = "";
    this.mark(this.view);
  }

  /** Follow the scene: another candidate is explained, what was clicked there is marked here. */
  mark({ snapshot }) {
    if (this.panel.hidden) return;
    const { integration, heuristic, candidate, pose, trial, revision } = snapshot;
    const wanted = JSON.stringify([integration, heuristic, candidate, pose, trial?.number, revision]);
    if (wanted !== this.#wanted) this.#ask(wanted);
    else this.#picked(snapshot.picked);
  }

  #ask(wanted) {
    this.#wanted = wanted;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#load(wanted), PAUSE);
  }

  async #load(wanted) {
    this.#loading?.abort();
    this.#loading = new AbortController();
    try {
      const told = await this.view.explanation(this.#loading.signal);
      if (wanted === this.#wanted) this.#draw(told);
    } catch (error) {
      if (error.name !== "AbortError") this.view.project.tell("trouble", error);
    }
  }

  #draw(told) {
    const { snapshot } = this.view;
    text(byId("why-note"), told ? note(told) : "There is no candidate to explain.");
    fill(byId("why-chains"), told ? told.chains.map((chain) => chainItem(chain, told.names)) : null);
    fill(byId("why-score"), told ? [crossings(told), score(told)] : null);
    this.#picked(snapshot.picked);
  }

  #picked(picked) {
    const chain = picked?.chain?.number ?? null;
    for (const button of this.panel.querySelectorAll("button")) {
      const { source, segment, number, first, second } = button.dataset;
      const here = source === "chain" ? Number(number) === chain : isPicked(picked, source, segment, first, second);
      if (here && button.getAttribute("aria-pressed") !== "true") reveal(button, this.panel);
      set(button, "aria-pressed", String(here));
    }
  }

  #choose(button) {
    if (!button) return;
    const { source, segment, number } = button.dataset;
    const value = source === "chain" ? { source, segment: Number(number) - 1 } : { source, segment: Number(segment) };
    const again = button.getAttribute("aria-pressed") === "true" && button.dataset.last === "true";
    for (const other of this.panel.querySelectorAll("button")) other.dataset.last = String(other === button && !again);
    this.view.act("set_picked", again ? null : value).catch((error) => this.view.project.tell("trouble", error));
  }
}

/** Scroll the panel, and only the panel, until something is in sight. */
function reveal(element, panel) {
  const [inner, outer] = [element.getBoundingClientRect(), panel.getBoundingClientRect()];
  if (inner.top < outer.top) panel.scrollTop += inner.top - outer.top;
  else if (inner.bottom > outer.bottom) panel.scrollTop += inner.bottom - outer.bottom;
}

/** A pair is marked when either of its segments is clicked. */
function isPicked(picked, source, segment, first, second) {
  if (!picked || picked.segment === undefined) return false;
  if (first === undefined) return picked.source === source && picked.segment === Number(segment);
  return (picked.source === "first" && picked.segment === Number(first)) || (picked.source === "second" && picked.segment === Number(second));
}

function note({ value, chains, small, names }) {
  const rest = small.reduce((sum, pair) => sum + pair.value, 0);
  const more = rest >= 0.005 ? `, and ${metres(rest)} of pairs too small to match` : "";
  const adds = `${count(chains.length, "chain")} of matching segments of ${names[0]} and ${names[1]} add${more}`;
  return `The value of ${metres(value)} is what ${adds}. Click one to see it in the scene, or a segment there to see it here.`;
}

function chainItem(chain, names) {
  const swatch = h("i.swatch", { "aria-hidden": "true" });
  swatch.style.background = chain.colour;
  const size = count(chain.first.length + chain.second.length, "segment");
  const told = { type: "button", "data-source": "chain", "data-number": chain.number, "aria-pressed": "false" };
  const head = h("button.chain", told, swatch, `Chain ${chain.number}: ${size}`, h("b.number", {}, metres(chain.value)));
  return h("li", {}, head, h("ul", {}, chain.pairs.map((pair) => h("li", {}, pairButton(pair, names)))));
}

function pairButton(pair, names) {
  const far = pair.factor < 1 ? `, ${fixed(100 * pair.distance, 1)} cm apart counts for ${fixed(100 * pair.factor, 0)} %` : "";
  const words = `${pair.first} on ${pair.second}: common ${metres(pair.common_1)} and ${metres(pair.common_2)}${far}`;
  const title = `Segment ${pair.first} of ${names[0]} on segment ${pair.second} of ${names[1]}`;
  const place = { "data-source": "first", "data-segment": pair.first, "data-first": pair.first, "data-second": pair.second };
  return h("button.pair", { type: "button", title, "aria-pressed": "false", ...place }, words, h("b.number", {}, metres(pair.value)));
}

function crossings({ crossings: found, discarded }) {
  if (!found.length) return null;
  const title = discarded ? "Long segments cross: paper mode discards it" : "Segments that cross";
  const each = (one) => h("li", {}, `${one.first} and ${one.second} at ${fixed(one.x, 2)}, ${fixed(one.y, 2)} m, ${fixed((one.angle * 180) / Math.PI, 0)}°`);
  return h("div.conflicts", {}, h("h3", {}, title), h("ul", {}, found.slice(0, 20).map(each)));
}

function score({ score: total, terms, conflicts, names }) {
  if (total === null) return null;
  const row = ([kind, size]) => h("tr", { class: kind }, h("th", { scope: "row" }, KINDS[kind] ?? kind), h("td", {}, metres(size)));
  const rows = Object.entries(terms).map(row);
  const table = h("table.numbers.terms", { "aria-label": "What makes up the score" }, h("tbody", {}, rows));
  const denied = conflicts.filter((one) => one.segment !== null).slice(0, 20);
  const list = denied.map((one) => h("li", {}, denial(one, names)));
  const title = denied.length ? h("h3", {}, "Denied by lines of sight, red in the stage “candidate”") : null;
  return [h("h3", {}, `Score ${metres(total)}`), table, title, h("ul.why.conflicts", {}, list)];
}

function denial({ source, segment, contradicted }, names) {
  const whose = names[source === "first" ? 0 : 1];
  const place = { "data-source": source, "data-segment": segment };
  return h("button.pair", { type: "button", "aria-pressed": "false", ...place }, `segment ${segment} of ${whose}`, h("b.number", {}, metres(contradicted)));
}
