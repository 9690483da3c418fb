// The heuristics on the selected pair: what each tried, how long it took, and what it found.

import { byId, fill, h } from "./dom.js";
import { degrees, duration, fixed, metres, pose, whole } from "./format.js";

export class Heuristics {
  constructor(project) {
    this.project = project;
    this.body = byId("heuristics-body");
    byId("heuristic-previous").addEventListener("click", () => this.#act("previous_heuristic"));
    byId("heuristic-next").addEventListener("click", () => this.#act("next_heuristic"));
    this.body.addEventListener("click", (event) => this.#choose(event.target.closest("tr")));
    this.body.addEventListener("keydown", (event) => this.#key(event));
  }

  show({ heuristics }, view) {
    this.view = view;
    const known = new Map(heuristics.map((found) => [found.heuristic, found]));
    const best = Math.max(0, ...heuristics.map((found) => found.value ?? 0));
    fill(this.body, this.project.info.heuristics.map((name) => line(name, known.get(name), best)));
    this.mark(view);
  }

  mark({ snapshot }) {
    for (const row of this.body.rows) {
      const chosen = row.dataset.heuristic === snapshot.heuristic;
      row.setAttribute("aria-selected", String(chosen));
      row.tabIndex = chosen ? 0 : -1;
    }
  }

  #choose(row) {
    if (!row) return;
    row.focus();
    this.#act("set_heuristic", row.dataset.heuristic);
  }

  #key(event) {
    const row = event.target.closest("tr");
    const next = { ArrowDown: row?.nextElementSibling, ArrowUp: row?.previousElementSibling }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    this.#choose(next);
  }

  #act(action, value) {
    this.view?.act(action, value).catch((error) => this.project.tell("trouble", error));
  }
}

function line(name, found, best) {
  const title = h("th", { scope: "row" }, name);
  if (!found) return h("tr", { "data-heuristic": name }, title, h("td.untried", { colspan: 3 }, "not tried yet: select it to try it"));
  const value = h("td", { class: found.value > 0 && found.value === best ? "best" : null }, found.pose ? metres(found.value) : "none");
  const draws = found.draws === null ? null : h("span.more", {}, `${whole(found.draws)} draws`);
  title.append(h("span.more", {}, where(found.pose)));
  return h("tr", { "data-heuristic": name }, title, h("td", {}, whole(found.candidates), draws), h("td", {}, duration(found.milliseconds)), value);
}

function where(found) {
  const place = pose(found);
  return place ? `${fixed(place.x, 2)}, ${fixed(place.y, 2)} m, ${degrees(place.theta)}°` : "no transformation";
}
