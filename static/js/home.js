// The home page: projects, samples, and the place to drop logs.

import { get, post } from "./api.js";
import { appearance } from "./appearance.js";
import { placeholder, projectCard, sampleCard } from "./cards.js";
import { byId, fill, h, text } from "./dom.js";
import { create, showDeleted } from "./keeping.js";
import { failed } from "./notices.js";
import { dropZone } from "./upload.js";

appearance(byId("appearance"));
dropZone(byId("drop"), open);
show(byId("projects"), listProjects);
show(byId("samples"), listSamples);
show(byId("lesson"), listStops);
byId("project-new").addEventListener("click", () => create(open));
addEventListener("pageshow", (event) => event.persisted && refresh());

/** Load the list again without emptying it first. */
async function refresh() {
  try {
    fill(byId("projects"), await listProjects());
  } catch (error) {
    failed(error);
  }
}

/** Fill a list; a list that cannot be loaded says why and offers to try again. */
async function show(list, load) {
  fill(list, placeholder(), placeholder());
  try {
    fill(list, await load());
  } catch (error) {
    fill(list, trouble(error, () => show(list, load)));
  }
  list.setAttribute("aria-busy", "false");
}

async function listProjects() {
  const { projects } = await get("/api/projects");
  text(byId("projects-note"), projects.length ? "" : "None yet. Drop a log above, or open a sample.");
  await showDeleted(refresh);
  return projects.map((project) => projectCard(project, refresh));
}

async function listSamples() {
  const { samples } = await get("/api/samples");
  return samples.length ? samples.map((sample) => sampleCard(sample, openSample)) : [h("li.muted", {}, "No samples are installed.")];
}

async function listStops() {
  const { stops } = await get("/api/lesson");
  return stops.map(({ title, say, url }) => h("li", { title: say }, h("a", { href: url }, title)));
}

async function openSample(name) {
  open(await post("/api/projects", { sample: name }));
}

function open(project) {
  location.assign(project.url);
}

function trouble(error, again) {
  const button = h("button", { type: "button", onclick: again }, "Try again");
  return h("li.message.error", { role: "alert" }, h("p", {}, error.message), h("div.row", {}, button));
}

