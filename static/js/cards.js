// Cards of the home page.

import { h } from "./dom.js";
import { ago, count, whole } from "./format.js";
import { projectMenu } from "./keeping.js";
import { failed } from "./notices.js";

const TALLY = ["accepted", "rejected", "pending"];

/** A card that stands where something is being loaded. */
export const placeholder = () => h("li.card.placeholder", { "aria-hidden": "true" });

/** A project: its map, its name, what it holds, when it last changed, and a menu; one that cannot be opened says why. */
export function projectCard(project, changed) {
  const map = project.integrations.accepted ? `/api/projects/${encodeURIComponent(project.id)}/map.svg` : null;
  const title = h("h3", {}, project.problem ? project.name : h("a", { href: project.url }, project.name));
  const told = project.problem ? h("p.trouble", {}, project.problem) : facts(project);
  return h("li.card", {}, picture(map, "No map yet"), h("div.body", {}, title, told), projectMenu(project, changed));
}

function facts(project) {
  const modified = h("p.muted", {}, ago(project.modified));
  return [h("p.muted", {}, holds(project)), modified, tally(project.integrations)];
}

/** A sample log and the button that opens it as a new project. */
export function sampleCard(sample, open) {
  const button = h("button", { type: "button", "aria-label": `Open ${sample.title}` }, "Open");
  button.addEventListener("click", () => opening(button, () => open(sample.name)));
  const walk = h("a.walk", { href: `/walk?${new URLSearchParams({ sample: sample.name })}` }, "Walk through");
  const ways = h("div.ways", {}, button, walk);
  const about = [h("h3", {}, sample.title), h("p.description", {}, sample.description), ways];
  const scans = h("p.muted", {}, count(sample.scans, "scan"));
  return h("li.card", {}, picture(sample.picture, "No picture"), h("div.body", {}, about[0], scans, ...about.slice(1)));
}

async function opening(button, work) {
  button.disabled = true;
  button.textContent = "Opening…";
  try {
    await work();
  } catch (error) {
    failed(error);
    button.disabled = false;
    button.textContent = "Open";
  }
}

function holds({ logs, scans, integrations }) {
  const decided = `${whole(integrations.accepted)} of ${count(integrations.total, "integration")} accepted`;
  return `${count(logs.length, "log")}, ${count(scans, "scan")}, ${decided}`;
}

/** A map picture; a sentence stands in its place where there is none. */
function picture(url, otherwise) {
  const sentence = h("p", {}, otherwise);
  if (!url) return h("div.picture", {}, sentence);
  const image = h("img", { src: url, alt: "", loading: "lazy" });
  image.addEventListener("error", () => image.replaceWith(sentence));
  return h("div.picture", {}, image);
}

/** How far the decisions are, as a bar. */
function tally(integrations) {
  const bar = h("div.tally", { "aria-hidden": "true" });
  const rest = integrations.total - TALLY.reduce((sum, state) => sum + (integrations[state] ?? 0), 0);
  for (const [state, number] of [...TALLY.map((name) => [name, integrations[name] ?? 0]), ["rest", rest]]) {
    if (number <= 0) continue;
    const part = h(`span.${state}`);
    part.style.flexGrow = number;
    bar.append(part);
  }
  return bar;
}
