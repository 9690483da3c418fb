// The page of a walkthrough: what is walked through stands in the address, and so does the step that is shown.

import { get } from "../api.js";
import { appearance } from "../appearance.js";
import { follow, teaching } from "./classes.js";
import { byId, fill, h, text } from "../dom.js";
import { failed } from "../notices.js";
import { Player } from "./player.js";
import { races } from "./races.js";

const AHEAD = 12;
const RESTING = 150;
const QUESTION = ["project", "sample", "pair", "merge", "node", "graph", "mode", "heuristic", "set"];

let question = new URLSearchParams(location.search);
const known = new Map();

const [, , , following] = location.pathname.startsWith("/follow/") ? location.pathname.split("/") : [];
const api = following ? `/follow/walk/${following}/api` : "/api/walk";
const lead = teaching(() => String(here));
let here = question;
let player = null;
let waiting = 0;

appearance(byId("appearance"));
(following ? follow(following, led) : start()).catch(unavailable);

async function start() {
  fill(byId("player"), h("p.message", { role: "status" }, "Integrating the scans, and noting every step…"));
  const walk = await get(following ? api : `${api}?${asked()}`);
  choices(walk);
  lesson().catch(failed);
  text(byId("name"), walk.title);
  document.title = `${walk.title} – segmap`;
  player = new Player(byId("player"), { ...walk, title: "Stages" }, { load, open, enter: into });
  player.addEventListener("step", ({ detail }) => following || remember(detail));
  byId("player").setAttribute("aria-busy", "false");
  await player.go(question.get("stage") || walk.stages[0].id, question.get("step") ?? 0);
  if (question.get("play") !== null) player.play();
}

/** Where the class is led: within the same walkthrough to another step, or to another one. */
async function led(place) {
  document.body.classList.add("following");
  const same = player && String(asked()) === String(asked({}, place));
  question = place;
  if (same) await player.go(place.get("stage"), place.get("step"));
  else await start();
}

/** Of a stop of the lesson: what it is about, and the way on. */
async function lesson() {
  const number = Number(question.get("lesson"));
  if (!number) return;
  const { stops } = await get("/api/lesson");
  const stop = stops[number - 1];
  if (!stop) return;
  const way = (to, words) => stops[to - 1] && h("a.button", { href: stops[to - 1].url }, words);
  const links = h("div.row", {}, way(number - 1, "Stop before"), way(number + 1, "Next stop"));
  const told = h("div", {}, h("h2", {}, `Lesson, stop ${number} of ${stops.length}: ${stop.title}`), h("p", {}, stop.say));
  byId("lesson").hidden = false;
  fill(byId("lesson"), told, links);
}

/** The part of the address that says what is walked through, with more for one request. */
function asked(more = {}, of = question) {
  const held = [...of].filter(([name]) => QUESTION.includes(name));
  return new URLSearchParams([...held, ...Object.entries(more)]);
}

/** Into one integration of a merge. */
function into(node) {
  location.assign(`?${asked({ node })}`);
}

async function open(stage) {
  try {
    return await get(`${api}/stage?${following ? new URLSearchParams({ stage }) : asked({ stage })}`);
  } catch (error) {
    return failed(error), null;
  }
}

/** A step: the one asked for at once, those after it for when they are wanted. */
async function load(stage, number) {
  const key = (place) => `${stage.id} ${place}`;
  if (!known.has(key(number))) keep(stage, number, 1);
  const step = await known.get(key(number));
  clearTimeout(waiting);
  const next = number + 1;
  const ahead = () => known.has(key(next)) || keep(stage, next, Math.min(AHEAD, stage.count - next));
  if (next < stage.count) waiting = setTimeout(ahead, RESTING);
  return step;
}

function keep(stage, start, count) {
  const which = { stage: stage.id, start, count };
  const answer = get(`${api}/steps?${following ? new URLSearchParams(which) : asked(which)}`);
  for (let place = 0; place < count; place += 1) {
    const step = answer.then(({ steps }) => steps[place]);
    known.set(`${stage.id} ${start + place}`, step);
    step.catch(() => known.delete(`${stage.id} ${start + place}`));
  }
}

function remember({ stage, step }) {
  const there = new URLSearchParams([...asked(), ["stage", stage], ["step", step]]);
  here = new URLSearchParams(there);
  lead.tell();
  if (question.get("lesson")) there.set("lesson", question.get("lesson"));
  history.replaceState(null, "", `?${there}`);
}

function choices(walk) {
  byId("what").value = walk.merging ? "merge" : "pair";
  byId("pair").value = question.get("merge") || walk.pair;
  if (question.get("project")) byId("what").append(h("option", { value: "graph" }, "pose graph"));
  if (question.get("graph")) byId("what").value = "graph";
  options(byId("mode"), walk.modes, walk.mode);
  options(byId("heuristic"), walk.heuristics, walk.heuristic);
  byId("mode").addEventListener("change", () => (byId("heuristic").value = ""));
  byId("how").addEventListener("submit", (event) => (event.preventDefault(), again()));
  const project = question.get("project");
  const back = project && h("a.button", { href: `/projects/${encodeURIComponent(project)}` }, "Project");
  const out = question.get("node") && h("a.button", { href: `?${without("node")}` }, "Back to the merge");
  const racing = !walk.merging && !question.get("graph") && !question.get("node") && races(asked);
  fill(byId("tools"), !following && [lead.button, racing, saving(), out, back]);
}

function without(name) {
  const held = asked();
  held.delete(name);
  return held;
}

/** The walkthrough as a file. */
function saving() {
  const kinds = [["html", "One page that plays offline"], ["zip", "Numbered pictures (PNG)"], ["gif", "Animation (GIF)"]];
  const link = ([kind, words]) => h("li", {}, h("a", { href: `/api/walk/file/${kind}?${asked()}`, download: "" }, words));
  return h("details.menu", {}, h("summary.button", {}, "Save"), h("ul", {}, kinds.map(link)));
}

function options(select, names, chosen) {
  fill(select, names.map((name) => h("option", { value: name, selected: name === chosen }, name)));
  select.value = chosen;
}

/** The same scans or others, integrated in another way. */
function again() {
  const there = new URLSearchParams([...question].filter(([name]) => ["project", "sample", "set"].includes(name)));
  for (const name of ["mode", "heuristic"]) if (byId(name).value) there.set(name, byId(name).value);
  there.set(byId("what").value, byId("what").value === "graph" ? "true" : row(byId("pair").value, byId("what").value));
  location.assign(`?${there}`);
}

/** Scans of a merge that were asked for as a pair: some that follow the first. */
function row(scans, what) {
  const [log, first, last] = (/^(\d+)\.(\d+)-\d+\.(\d+)$/.exec(scans) ?? []).slice(1).map(Number);
  if (what === "pair" && last > first + 1 && question.get("merge") === scans) return `${log}.${first}-${log}.${first + 1}`;
  return what === "merge" && last === first + 1 ? `${log}.${first}-${log}.${first + 6}` : scans;
}

function unavailable(error) {
  const button = h("button", { type: "button", onclick: () => location.reload() }, "Try again");
  fill(byId("player"), h("div.message.error", { role: "alert" }, h("p", {}, error.message), h("div.row", {}, button)));
  byId("player").setAttribute("aria-busy", "false");
}
