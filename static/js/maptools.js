// Tools of the merged map: what its colours say, another map beside it, measuring, and where a clicked wall comes from.

import { get } from "./api.js";
import { byId, fill, h, text } from "./dom.js";
import { degrees, fixed, metres, pair } from "./format.js";
import { failed } from "./notices.js";

/** Wire the tools to the view; the list of maps to compare with is asked for when somebody reaches for it. */
export function mapTools(project, view) {
  const act = (action) => (event) => view.act(action, event.target.value).catch(failed);
  byId("map-colouring").addEventListener("change", act("set_colouring"));
  byId("map-compare").addEventListener("change", act("set_compare"));
  byId("map-side").addEventListener("change", act("set_side"));
  byId("map-measure").addEventListener("click", () => view.act("toggle_measuring").catch(failed));
  byId("map-show").addEventListener("click", () => view.act("set_stage", "map").catch(failed));
  const others = () => offer(project, view).catch(failed);
  for (const kind of ["pointerenter", "focus"]) byId("map-compare").addEventListener(kind, others);
  view.addEventListener("changed", () => show(view));
}

/** Ask what the map can be compared with. */
async function offer(project, view) {
  const { options } = await get(`${project.url}/others`);
  choices(byId("map-compare"), [{ name: "", title: "nothing" }, ...options], view.snapshot.map?.compare ?? "");
}

function show({ snapshot }) {
  const { map, measuring, measured, picked, stage } = snapshot;
  if (!map) return;
  byId("map-show").hidden = stage === "map";
  choices(byId("map-colouring"), map.colourings, map.colouring);
  const others = [...byId("map-compare").options].map(({ value, label }) => ({ name: value, title: label }));
  if (map.other && !others.some(({ name }) => name === map.other.name)) others.push(map.other);
  choices(byId("map-compare"), others, map.compare);
  byId("map-side-label").hidden = !map.compare;
  byId("map-side").value = map.side;
  byId("map-measure").setAttribute("aria-pressed", String(measuring));
  text(byId("map-told"), [problem(map.other), distance(measuring, measured)].filter(Boolean).join(" "));
  clicked(picked);
}

/** Fill a select, unless it shows just that already: a list somebody has open is left alone. */
function choices(select, options, chosen) {
  const held = [...select.options].map(({ value }) => value).join("\n");
  if (held !== options.map(({ name }) => name).join("\n")) {
    fill(select, options.map(({ name, title }) => h("option", { value: name }, title)));
  }
  if (select.value !== chosen) select.value = chosen;
}

const problem = (other) => (other?.problem ? `${other.title}: ${other.problem}.` : "");

function distance(measuring, measured) {
  if (measured) return `${metres(measured.length)} (x ${fixed(measured.dx, 2)}, y ${fixed(measured.dy, 2)}, ${degrees(measured.heading)}°).`;
  return measuring ? "Click two places in the scene; ends of walls nearby are meant." : "";
}

/** A wall of the merged map: which scans saw it, and which decisions put it there. */
function clicked(picked) {
  const box = byId("map-clicked");
  box.hidden = !picked?.integrations;
  if (box.hidden) return;
  const { segment, length, scans, integrations, between, more, misfit } = picked;
  const off = misfit === null ? "" : `, ${fixed(100 * misfit, 1)} cm misfit`;
  const seen = scans.length ? `seen by ${scans.length === 1 ? "scan" : "scans"} ${scans.join(", ")}` : "put in between to connect others";
  const held = between ? "Integrations between these scans:" : "Integrations that hold them:";
  const list = integrations.length ? [h("p", {}, held), h("ul", {}, integrations.map(decision), more ? h("li", {}, `and ${more} more`) : null)] : null;
  fill(box, h("p", {}, h("b", {}, `Wall ${segment}`), `, ${metres(length)}${off}; ${seen}.`), list);
}

function decision({ id, who, value, confidence, silenced }) {
  const told = [who ? `accepted by ${who}` : "accepted"];
  if (confidence !== null) told.push(`confidence ${fixed(confidence, 2)}`);
  else if (value !== null) told.push(metres(value));
  if (silenced) told.push("left out by the optimiser");
  return h("li", {}, h("a", { href: `#${id}`, "data-integration": id }, pair(id)), `, ${told.join(", ")}`);
}
