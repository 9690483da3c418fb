// What the project holds: the components of the merged map, and the logs with what was left out of them.

import { byId, fill, h } from "./dom.js";
import { count, metres, whole } from "./format.js";
import { failed } from "./notices.js";
import { sentence } from "./problems.js";

const LINES = 50;
const EMPTY = "The map is empty: accept an integration, and its scans are merged.";

/** Keep both lists up to date; what has not changed is left as it is, with its details open or closed. */
export function summary(project, view) {
  const showMap = whenChanged(components);
  const showLogs = whenChanged(logs);
  project.addEventListener("info", () => {
    showMap(mapFacts(project, view));
    showLogs({ logs: project.info.logs });
  });
  view.addEventListener("changed", () => project.info && showMap(mapFacts(project, view)));
  byId("components").addEventListener("click", (event) => act(event, view));
}

/** What the list of components shows; those of the view are theirs: colours, and which are hidden. */
function mapFacts({ info }, { snapshot }) {
  const { components: parts, unplaced, merging } = info;
  const { colours = {}, hidden = [] } = snapshot.map ?? {};
  return { components: parts, unplaced, merging, colours, hidden };
}

function act(event, view) {
  const button = event.target.closest("[data-action]");
  if (button) view.act(button.dataset.action, button.dataset.first).catch(failed);
}

function whenChanged(show) {
  let shown = "";
  return (facts) => {
    const wanted = JSON.stringify(facts);
    if (wanted !== shown) show(facts);
    shown = wanted;
  };
}

function components({ components: all, unplaced, merging, colours, hidden }) {
  const state = merging ? h("li.muted", {}, "The map is being computed…") : all.length === 0 && h("li.muted", {}, EMPTY);
  fill(byId("components"), state, all.map((one) => component(one, colours, hidden, all.length)), aloneItem(unplaced));
}

function component({ name, scans, segments, length }, colours, hidden, count_) {
  const [first] = scans;
  const size = `${count(scans.length, "scan")}, ${count(segments, "segment")}, ${metres(length, 1)} of walls`;
  const list = h("details", {}, h("summary", {}, `Scans ${first} to ${scans.at(-1)}`), h("p.ids", {}, scans.join(", ")));
  const swatch = h("span.swatch", { "aria-hidden": "true" });
  swatch.hidden = !colours[first];
  swatch.style.background = colours[first] ?? "";
  const shown = !hidden.includes(first);
  const see = choice("toggle_component", first, shown ? "Hide" : "Show", `${shown ? "Hide" : "Show"} ${name} in the scene`);
  const only = choice("isolate", first, shown && hidden.length ? "All" : "Only", `Show only ${name}, or all again`);
  const tools = count_ > 1 ? h("span.row", {}, see, only) : null;
  return h("li", { class: shown ? null : "off" }, h("h3", {}, swatch, name, tools), h("p", {}, size), list);
}

function choice(action, first, label, title) {
  return h("button.quiet.small", { type: "button", "data-action": action, "data-first": first, "aria-label": title, title }, label);
}

function aloneItem(scans) {
  if (!scans.length) return null;
  const list = h("details", {}, h("summary", {}, "Which"), h("p.ids", {}, scans.join(", ")));
  return h("li", {}, h("h3", {}, "Not placed"), h("p", {}, `${count(scans.length, "scan")} without an accepted integration`), list);
}

function logs({ logs: all }) {
  fill(byId("logs"), all.map(log));
}

function log({ name, format, scans, no_return: none, problems }, index) {
  const facts = [format, count(scans, "scan"), none ? `${none} m means no return` : null].filter(Boolean).join(", ");
  return h("li", {}, h("h3", {}, `${index}: ${name}`), h("p", {}, facts), problemList(problems ?? []));
}

function problemList(problems) {
  if (!problems.length) return null;
  const lines = problems.slice(0, LINES).map((problem) => h("li", {}, sentence(problem)));
  if (problems.length > LINES) lines.push(h("li", {}, `and ${whole(problems.length - LINES)} more`));
  const title = h("summary", {}, `${count(problems.length, "line")} left out`);
  return h("details.problems", {}, title, h("ul", {}, lines));
}
