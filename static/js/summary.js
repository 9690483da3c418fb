// What the project holds: the components of the merged map, and the logs with what was left out of them.

import { byId, fill, h } from "./dom.js";
import { count, metres, whole } from "./format.js";
import { sentence } from "./problems.js";

const LINES = 50;
const EMPTY = "The map is empty: accept an integration, and its scans are merged.";

/** Keep both lists up to date; what has not changed is left as it is, with its details open or closed. */
export function summary(project) {
  const showMap = whenChanged(components);
  const showLogs = whenChanged(logs);
  project.addEventListener("info", () => {
    const { components: parts, unplaced, merging, logs: files } = project.info;
    showMap({ components: parts, unplaced, merging });
    showLogs({ logs: files });
  });
}

function whenChanged(show) {
  let shown = "";
  return (facts) => {
    const wanted = JSON.stringify(facts);
    if (wanted !== shown) show(facts);
    shown = wanted;
  };
}

function components({ components: all, unplaced, merging }) {
  const state = merging ? h("li.muted", {}, "The map is being computed…") : all.length === 0 && h("li.muted", {}, EMPTY);
  fill(byId("components"), state, all.map(component), aloneItem(unplaced));
}

function component({ name, scans, segments, length }) {
  const size = `${count(scans.length, "scan")}, ${count(segments, "segment")}, ${metres(length, 1)} of walls`;
  const list = h("details", {}, h("summary", {}, `Scans ${scans[0]} to ${scans.at(-1)}`), h("p.ids", {}, scans.join(", ")));
  return h("li", {}, h("h3", {}, name), h("p", {}, size), list);
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
