// Keeping projects: new ones, other names, copies, deletions that can be undone.

import { call, get, post } from "./api.js";
import { askName, askWhether } from "./ask.js";
import { byId, fill, h, icon, text } from "./dom.js";
import { ago, count } from "./format.js";
import { menu } from "./menu.js";
import { failed, notice } from "./notices.js";

export const urlOf = (project) => `/api/projects/${encodeURIComponent(project.id)}`;

/** Ask for another name of a project. */
export function rename(project, done) {
  askName({
    title: "Rename the project",
    label: "Name",
    value: project.name,
    button: "Rename",
    use: async (name) => done(await call(urlOf(project), patch({ name }))),
  });
}

/** Ask for the name of a new project, without logs. */
export function create(done) {
  askName({ title: "New project", label: "Name", button: "Create", use: async (name) => done(await post("/api/projects", { name })) });
}

/** The menu of a project's card; `changed()` is called when the list is another one. */
export function projectMenu(project, changed) {
  const run = (work) => () => work(project, changed).catch(failed);
  const item = (label, onclick) => h("li", {}, h("button", { type: "button", onclick }, label));
  const whole = project.problem ? [] : [
    item("Rename…", () => rename(project, changed)),
    item("Duplicate", run(duplicate)),
    h("li", {}, h("a", { href: `${urlOf(project)}/download`, download: "" }, "Download .segmap")),
  ];
  const summary = h("summary.button", { "aria-label": `More for ${project.name}`, title: "More" }, icon("more"));
  return menu(h("details.menu", {}, summary, h("ul", {}, whole, item("Delete", run(remove)))));
}

async function duplicate(project, changed) {
  const made = await post(`${urlOf(project)}/duplicate`);
  await changed();
  notice(`${made.name} is there.`);
}

async function remove(project, changed) {
  await call(urlOf(project), { method: "DELETE" });
  await changed();
  byId("projects-title").focus();
  notice(`${project.name} is deleted.`, { action: { label: "Undo", run: () => restore(project, changed).catch(failed) } });
}

/** Have a deleted project back. */
export async function restore(project, changed) {
  const { name } = await post(`/api/deleted/${encodeURIComponent(project.id)}/restore`);
  await changed();
  notice(`${name} is back.`);
}

/** Show what was deleted and can be had back. */
export async function showDeleted(changed) {
  const { projects } = await get("/api/deleted");
  byId("deleted").hidden = projects.length === 0;
  text(byId("deleted-title"), `${count(projects.length, "deleted project")}`);
  fill(byId("deleted-list"), projects.map((project) => deletedItem(project, changed)));
}

function deletedItem(project, changed) {
  const back = h("button", { type: "button", "aria-label": `Restore ${project.name}`, onclick: () => restore(project, changed).catch(failed) }, "Restore");
  const ask = { type: "button", "aria-label": `Delete ${project.name} for good`, onclick: () => forGood(project, changed) };
  const gone = h("button.quiet", ask, "Delete for good…");
  return h("li", {}, h("span", {}, project.name), project.modified ? h("span.muted", {}, `changed ${ago(project.modified)}`) : null, back, gone);
}

function forGood(project, changed) {
  askWhether({
    title: `Delete ${project.name} for good?`,
    sentence: "Its logs, decisions and map are removed from this computer. This cannot be undone.",
    button: "Delete for good",
    use: async () => {
      await call(`/api/deleted/${encodeURIComponent(project.id)}`, { method: "DELETE" });
      await changed();
    },
  });
}

const patch = (body) => ({ method: "PATCH", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
