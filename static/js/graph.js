// What the pose graph says: of the selected integration, and of the whole map.

import { byId, fill, h, text } from "./dom.js";
import { count, degrees, fixed, metres, pair } from "./format.js";

const PAUSE = 250;
const FIRM = "Nothing holds it by a single integration.";

/** Metres and degrees in words. */
export const off = (metresOff, turn) => `${fixed(metresOff, 2)} m and ${degrees(turn)}°`;

/** The sentences under the selected integration: who proposed it, what the graph makes of it, what accepting it would do. */
export class GraphWords {
  #wanted = "";
  #timer = 0;
  #loading = null;

  constructor(project) {
    this.project = project;
    this.list = byId("detail-graph");
  }

  show({ row, told }, view) {
    this.row = row;
    this.told = told;
    this.#wanted = "";
    this.#draw([]);
    this.mark(view);
  }

  /** Another candidate: what would come of accepting that one? */
  mark({ integration, snapshot }) {
    if (!this.row || this.row.id !== integration) return;
    const asked = this.row.state !== "accepted" && !snapshot.trial && !snapshot.held;
    const query = `heuristic=${encodeURIComponent(snapshot.heuristic ?? "")}&candidate=${snapshot.candidate ?? 0}`;
    const wanted = asked && snapshot.candidates > 0 ? `${this.project.url}/integrations/${encodeURIComponent(integration)}/preview?${query}` : "";
    if (wanted === this.#wanted) return;
    this.#wanted = wanted;
    this.#loading?.abort();
    clearTimeout(this.#timer);
    if (wanted) this.#timer = setTimeout(() => this.#load(wanted), PAUSE);
  }

  async #load(url) {
    this.#loading = new AbortController();
    try {
      const preview = await this.project.preview(url, this.#loading.signal);
      if (url !== this.#wanted) return;
      if (preview) this.#draw(preview.sentences, preview.silenced || preview.contradicts.length > 0);
      else this.#draw([]);
    } catch (error) {
      if (error.name !== "AbortError" && url === this.#wanted) this.#draw([]);
    }
  }

  #draw(sentences, doubtful = false) {
    const silenced = this.row.silenced ? "silenced" : "";
    const told = this.told.map((sentence) => h("li", { class: silenced }, sentence));
    const preview = sentences.map((sentence) => h("li", {}, sentence));
    const title = preview.length ? h("li.title", { class: doubtful ? "title doubtful" : "title" }, "If you accept the candidate shown:") : null;
    fill(this.list, told, title, preview);
  }
}

/** The graph of the whole map, above the list of its components. */
export function graphPanel(project) {
  let shown = "";
  project.addEventListener("info", () => {
    const { graph } = project.info;
    const wanted = JSON.stringify(graph);
    if (wanted !== shown) draw(graph);
    shown = wanted;
  });
}

function draw({ edges, silenced, strengths, optimising }) {
  text(byId("graph-state"), optimising ? "The pose graph is being optimised…" : "");
  const title = silenced.length ? h("h3.silenced", {}, `The optimiser silences ${count(silenced.length, "accepted integration")}`) : null;
  const told = silenced.map(({ id, sentence }) => h("li", {}, link(id), " ", sentence));
  fill(byId("graph-silenced"), title, silenced.length ? h("ul", {}, told) : null);
  fill(byId("graph-strength"), edges ? strengths.map(strength) : null);
}

function strength(one, index) {
  const { first, scans, edges, bridges, hanging, softest, deviation } = one;
  const loops = edges - scans + 1;
  const size = `${count(edges, "integration")} hold ${count(scans, "scan")}: ${count(loops, "loop")}`;
  const name = h("h3", {}, `How firmly component ${index + 1} holds`);
  const held = bridges.length ? `${count(bridges.length, "integration")} alone hold two parts together, nothing checks them` : FIRM;
  const list = bridges.length ? h("details", {}, h("summary", {}, "Which"), h("p.ids", {}, bridges.slice(0, 200).map((id) => [link(id), " "]))) : null;
  const hangs = hanging ? h("p", {}, `${count(hanging, "scan")} hang on by one integration.`) : null;
  const soft = h("p", {}, `Least sure is scan ${softest}, seen from ${first}: ± ${metres(deviation)}.`);
  return h("li", {}, name, h("p", {}, `${size}. ${held}${bridges.length ? "." : ""}`), list, hangs, misses(one), soft);
}

/** By how much the loop misses itself that does most. */
function misses({ loop, loop_scans, loop_error, loop_turn }) {
  if (!loop) return null;
  const size = count(loop_scans, "scan");
  return h("p", {}, `The largest loop closure error is ${off(loop_error, loop_turn)}, round the ${size} that `, link(loop), " closes.");
}

function link(id) {
  return h("a", { href: `#${id}`, "data-integration": id }, pair(id));
}

/** A click on an integration named anywhere in the panels selects it. */
export function integrationLinks(root, select) {
  root.addEventListener("click", (event) => {
    const named = event.target.closest("[data-integration]");
    if (!named) return;
    event.preventDefault();
    select(named.dataset.integration);
  });
}
