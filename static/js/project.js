// A project's page: the queue at the left, the scene in the middle with the panel of the current step at its right.

import { Candidates } from "./candidates.js";
import { Detail, prepare } from "./detail.js";
import { byId, h, text } from "./dom.js";
import { exportMenu } from "./exports.js";
import { GraphWords, graphPanel, integrationLinks } from "./graph.js";
import { head } from "./head.js";
import { Heuristics } from "./heuristics.js";
import { reviewer, reasons } from "./reviewer.js";
import { inputs } from "./inputs.js";
import { restore } from "./keeping.js";
import { listen, sheet } from "./keys.js";
import { loops } from "./loops.js";
import { mapTools } from "./maptools.js";
import { Project } from "./model.js";
import { announce, failed } from "./notices.js";
import { ParameterDrawer } from "./parameters.js";
import { pair } from "./format.js";
import { Queue, stateLabel } from "./queue.js";
import { cover, scene } from "./scene.js";
import { sharing } from "./share.js";
import { Stream } from "./stream.js";
import { summary } from "./summary.js";
import { tabs } from "./tabs.js";
import { Threshold } from "./threshold.js";
import { View } from "./view.js";
import { walkLink } from "./walks.js";
import { Why } from "./why.js";

const project = new Project(decodeURIComponent(location.pathname.split("/")[2] ?? ""));
const view = new View(project);
const showTab = tabs(byId("tabs"));
const candidates = new Candidates();
const queue = new Queue(project, view, () => (showTab("tab-candidates"), candidates.focus()));

start().catch(unavailable);

async function start() {
  prepare(byId("detail-state"));
  new Detail(project, view, [candidates, new Heuristics(project), new GraphWords(project), new Why(view)]);
  new Threshold(project, view, queue);
  new ParameterDrawer(project, view);
  const parts = [reviewer, reasons, head, summary, exportMenu, inputs, loops, mapTools, sharing, graphPanel, walkLink];
  for (const part of parts) part(project, view);
  project.addEventListener("trouble", ({ detail }) => failed(detail));
  integrationLinks(byId("panel-map"), (id) => queue.select(id));
  sheet(byId("help"));
  byId("help-open").addEventListener("click", help);
  listen(actions());
  await project.load();
  byId("workbench").setAttribute("aria-busy", "false");
  await connect();
}

/** Open the view and its scene, and follow both from now on. */
async function connect() {
  const stream = new Stream({ hear, lost, back, refused: () => again(stream) });
  project.addEventListener("deleted", () => gone(stream));
  scene(view, actions());
  view.addEventListener("opened", () => listenTo(stream));
  view.addEventListener("changed", remember);
  addEventListener("pagehide", () => view.close());
  addEventListener("pageshow", (event) => event.persisted && view.open().catch(failed));
  document.addEventListener("visibilitychange", () => document.hidden || view.check().catch(failed));
  await look(stream, decodeURIComponent(location.hash.slice(1)));
}

/** Open the view; where that fails, the queue is there nevertheless. */
async function look(stream, integration) {
  try {
    if (project.rows.length) return await view.open(integration);
    cover("There is nothing to show: this project has no pair of scans.");
    lookLater(stream);
    return listenTo(stream);
  } catch (error) {
    listenTo(stream);
    return cover(`The scene cannot be opened. ${error.message}`, () => look(stream, integration));
  }
}

/** Open the view as soon as there is a pair, as when logs are added. */
function lookLater(stream) {
  const begin = () => {
    if (!project.rows.length) return;
    project.removeEventListener("rows", begin);
    look(stream, "");
  };
  project.addEventListener("rows", begin);
}

/** Somebody deleted the project: stop asking for it, say so, and offer to have it back. */
function gone(stream) {
  stream.close();
  view.forget();
  cover("");
  const back = h("button.primary", { type: "button", onclick: () => restore(project, () => location.reload()).catch(failed) }, "Restore it");
  const ways = h("div.row", {}, back, h("a.button", { href: "/" }, "All projects"));
  const message = h("div.message.error", { role: "alert" }, h("p", {}, "This project was deleted."), ways);
  byId("workbench").replaceChildren(h("div.unavailable", {}, message));
}

function listenTo(stream) {
  stream.open(`${project.url}/events${view.id ? `?view=${encodeURIComponent(view.id)}` : ""}`);
}

/** The server does not know the view any more, as after a restart: open another, or listen again where it does. */
async function again(stream) {
  const before = view.id;
  await view.check().catch(() => {});
  if (view.id === before) listenTo(stream);
}

function hear(event) {
  if (event.type !== "view") project.hear(event);
  else if ((event.view ?? view.id) === view.id) view.hear(event.snapshot ?? event);
}

function lost() {
  byId("offline").hidden = false;
}

function back() {
  byId("offline").hidden = true;
  project.refresh();
  view.check().catch(failed);
}

/** Keep the selection in the address, so that a reload and a link lead back to it. */
function remember() {
  const wanted = view.integration ? `#${view.integration}` : "";
  if (location.hash === wanted) return;
  history.replaceState(null, "", wanted || location.pathname + location.search);
  const row = project.row(view.integration);
  if (row) announce(`${pair(row.id)}, ${stateLabel(row.state)}`);
}

/** What each key does, in the page and in the scene. */
function actions() {
  const act = (action) => () => view.act(action).catch(failed);
  const actions = { next: () => queue.turn(1), previous: () => queue.turn(-1), search, help, reason, queue: toQueue, enter: () => {} };
  for (const name of ["accept", "reject"]) actions[name] = () => view.decide(name).catch(failed);
  const plain = ["skip", "undo", "redo", "toggle_dimension", "toggle_nudging", "toggle_measuring", "fit"];
  for (const name of plain) actions[name] = act(name);
  actions.stage = (number) => view.snapshot.stages && view.act("set_stage", view.snapshot.stages[number - 1]).catch(failed);
  for (const what of ["candidate", "heuristic", "stage"]) {
    for (const way of ["next", "previous"]) actions[`${way}_${what}`] = act(`${way}_${what}`);
  }
  return actions;
}

function help() {
  byId("help").showModal();
}

function search() {
  type(byId("search"));
}

function reason() {
  showTab("tab-candidates");
  type(byId("reason"));
}

function toQueue() {
  window.focus();
  byId("queue").focus();
}

/** Bring the keyboard into a field, from the scene too. */
function type(field) {
  window.focus();
  field.select();
  field.focus();
}

/** The project cannot be shown at all: say why, and lead back. */
function unavailable(error) {
  const home = h("a.button", { href: "/" }, "All projects");
  const again = h("button.primary", { type: "button", onclick: () => location.reload() }, "Try again");
  const message = h("div.message.error", { role: "alert" }, h("p"), h("div.row", {}, again, home));
  text(message.firstElementChild, error.message);
  byId("workbench").replaceChildren(h("div.unavailable", {}, message));
}
