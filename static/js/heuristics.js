// The heuristics on the selected pair: what each tried, how long it took, and what it found.

import { byId, fill, h, text } from "./dom.js";
import { degrees, duration, fixed, measured, pose, whole } from "./format.js";

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
    const { criterion } = this.project;
    const best = Math.max(0, ...heuristics.map((found) => found[criterion.quantity] ?? 0));
    text(byId("heuristics-quantity"), criterion.quantity);
    fill(this.body, this.project.info.heuristics.map((name) => line(name, known.get(name), criterion, best)));
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

function line(name, found, { quantity, unit }, best) {
  const title = h("th", { scope: "row" }, name);
  if (!found) return h("tr", { "data-heuristic": name }, title, h("td.untried", { colspan: 3 }, "not tried yet: select it to try it"));
  const number = found[quantity];
  const value = h("td", { class: number > 0 && number === best ? "best" : null }, found.pose ? measured(number, unit) : "none");
  const draws = found.draws === null ? null : h("span.more", {}, `${whole(found.draws)} draws`);
  title.append(h("span.more", {}, where(found.pose)));
  return h("tr", { "data-heuristic": name }, title, h("td", {}, whole(found.candidates), draws), h("td", {}, duration(found.milliseconds)), value);
}

function where(found) {
  const place = pose(found);
  return place ? `${fixed(place.x, 2)}, ${fixed(place.y, 2)} m, ${degrees(place.theta)}°` : "no transformation";
}
