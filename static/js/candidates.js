// The candidates of the selected integration, best first or sorted by a column; a click moves the second map in the scene.

import { byId, fill, h, set, text } from "./dom.js";
import { count, degrees, fixed, pose, whole } from "./format.js";

const MOST = 500;
const COLUMNS = [
  { label: "#", title: "rank", of: (c) => c.rank, show: (c) => c.rank + 1 },
  { label: "value", title: "value of the transformation, metres", of: (c) => -c.value, show: (c) => fixed(c.value, 2) },
  { label: "score", title: "support of lines of sight less conflict, metres", of: (c) => -c.score, show: (c) => fixed(c.score, 2) },
  { label: "x", title: "metres", of: (c) => c.pose.x, show: (c) => fixed(c.pose.x, 2) },
  { label: "y", title: "metres", of: (c) => c.pose.y, show: (c) => fixed(c.pose.y, 2) },
  { label: "θ°", title: "degrees", of: (c) => c.pose.theta, show: (c) => degrees(c.pose.theta) },
  { label: "angles", title: "the segments of the first and of the second map that are laid on each other", of: (c) => c.angle_1[0], show: angles },
];

export class Candidates {
  #candidates = [];
  #column = 0;
  #reverse = false;
  #integration = null;

  constructor() {
    this.body = byId("candidates-body");
    fill(byId("candidates-head"), COLUMNS.map((column, index) => this.#header(column, index)));
    this.table = byId("candidates-table");
    this.body.addEventListener("click", (event) => this.#choose(event.target.closest("tr")));
    this.body.addEventListener("keydown", (event) => this.#key(event));
  }

  show({ match, claimed, nudged }, view) {
    this.view = view;
    const listed = (found, rank) => ({ ...found, rank, claimed: rank === claimed, nudged: rank === nudged, pose: pose(found.T_1_2) });
    this.#candidates = (match?.ranked ?? []).map(listed);
    text(byId("candidates-note"), note(match, this.#candidates.length));
    const words = ambiguity(this.#candidates);
    byId("candidates-ambiguity").hidden = words === null;
    if (words) Object.assign(byId("candidates-ambiguity").dataset, { how: words.how });
    text(byId("candidates-ambiguity"), words?.sentence);
    this.table.hidden = this.#candidates.length === 0;
    this.table.classList.toggle("unscored", match?.mode === "paper");
    this.#draw();
    if (view.integration !== this.#integration) byId("panel-candidates").scrollTop = 0;
    this.#integration = view.integration;
  }

  /** Mark the candidate the scene shows; where it became another one, its row comes into sight. */
  mark({ snapshot }) {
    const rank = snapshot.held ? null : String(snapshot.candidate ?? 0);
    for (const row of this.body.rows) {
      const chosen = row.dataset.rank === rank;
      if (chosen && row.getAttribute("aria-selected") === "false") reveal(row, byId("panel-candidates"));
      set(row, "aria-selected", String(chosen));
      row.tabIndex = chosen ? 0 : -1;
    }
  }

  /** Put the keyboard on the selected candidate. */
  focus() {
    this.body.querySelector("[aria-selected=true]")?.focus();
  }

  #draw() {
    const { of } = COLUMNS[this.#column];
    const sorted = [...this.#candidates].sort((a, b) => (of(a) - of(b) || a.rank - b.rank) * (this.#reverse ? -1 : 1));
    fill(this.body, sorted.slice(0, MOST).map(line));
    this.#headers();
    if (this.view) this.mark(this.view);
  }

  #header({ label, title }, index) {
    const button = h("button", { type: "button", title: `sort by ${title}`, onclick: () => this.#sort(index) }, label);
    return h("th", { scope: "col" }, button);
  }

  #headers() {
    [...byId("candidates-head").children].forEach((header, index) => {
      const order = this.#reverse ? "descending" : "ascending";
      set(header, "aria-sort", index === this.#column ? order : null);
    });
  }

  #sort(index) {
    this.#reverse = index === this.#column && !this.#reverse;
    this.#column = index;
    this.#draw();
  }

  #choose(row) {
    if (!row || !this.view) return;
    row.focus();
    this.view.act("set_candidate", Number(row.dataset.rank)).catch((error) => this.view.project.tell("trouble", error));
  }

  #key(event) {
    const row = event.target.closest("tr");
    const next = { ArrowDown: row?.nextElementSibling, ArrowUp: row?.previousElementSibling }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    this.#choose(next);
  }
}

function angles({ angle_1: first, angle_2: second, claimed, nudged }) {
  if (nudged) return "by hand";
  if (claimed) return "claimed";
  const told = (segments) => [...new Set(segments)].join("·");
  return `${told(first)} → ${told(second)}`;
}

/** Scroll the panel, and only the panel, until the row is in sight below the sticky head. */
function reveal(row, panel) {
  const [inner, outer] = [row.getBoundingClientRect(), panel.getBoundingClientRect()];
  const above = inner.top - inner.height - outer.top;
  const below = inner.bottom - outer.bottom;
  if (above < 0) panel.scrollTop += above;
  else if (below > 0) panel.scrollTop += below;
}

function line(candidate) {
  const cells = COLUMNS.map((column) => h("td", {}, String(column.show(candidate))));
  return h("tr", { "data-rank": candidate.rank, "aria-selected": "false" }, cells);
}

const APART = { metres: 0.5, radians: 0.2 };
const CLOSE = 0.8;
const RIVAL = 0.5;

/** How near the best answer that is another one comes to the best: one peak, or several? */
function ambiguity(candidates) {
  const found = candidates.filter((c) => !c.claimed && !c.nudged);
  const [best] = found;
  if (!best) return null;
  const merit = (c) => c.score ?? c.value;
  const rival = found.find((c) => apart(best.pose, c.pose));
  if (!rival || merit(best) <= 0) return { how: "clear", sentence: "No other candidate says something else." };
  const share = Math.max(0, merit(rival) / merit(best));
  const how = share >= CLOSE ? "ambiguous" : share >= RIVAL ? "rival" : "clear";
  const word = { ambiguous: "Ambiguous", rival: "There is a rival", clear: "Clear" }[how];
  const [far, turn] = [Math.hypot(rival.pose.x - best.pose.x, rival.pose.y - best.pose.y), turned(best.pose, rival.pose)];
  const what = best.score === null ? "value" : "score";
  const where = `candidate ${rival.rank + 1}, ${fixed(far, 1)} m and ${degrees(turn)}° from the best`;
  return { how, sentence: `${word}: ${where}, has ${fixed(100 * share, 0)} % of its ${what}.` };
}

const turned = (a, b) => Math.abs(Math.atan2(Math.sin(a.theta - b.theta), Math.cos(a.theta - b.theta)));
const apart = (a, b) => Math.hypot(a.x - b.x, a.y - b.y) > APART.metres || turned(a, b) > APART.radians;

function note(match, kept) {
  if (!match) return "";
  const [first, second] = match.segments;
  const tried = `${count(match.candidates, "candidate")} on ${first} × ${second} segments, ${whole(match.discarded)} discarded`;
  return kept < match.candidates - match.discarded ? `${tried}; the best ${whole(kept)}:` : `${tried}.`;
}
