// The page of who follows a view: the scene as the other person has it, and nothing to press.

import { get } from "./api.js";
import { byId, text } from "./dom.js";
import { pair } from "./format.js";
import { Stream } from "./stream.js";

const BASE = `/follow/${location.pathname.split("/")[2] ?? ""}`;
const AGAIN = 2000;
let theme = "";

start();

async function start() {
  try {
    const { project, scene, snapshot } = await get(`${BASE}/view`);
    text(byId("name"), project);
    document.title = `${project} – following, segmap`;
    byId("scene").addEventListener("load", () => cover(""), { once: true });
    byId("scene").src = snapshot.theme === "dark" ? `${scene}?darkMode` : scene;
    show(snapshot);
    listen();
  } catch (error) {
    cover(error.message);
  }
}

function listen() {
  const stream = new Stream({
    hear: (event) => event.type === "view" && show(event),
    lost: () => cover("The server does not answer; trying again…"),
    back: () => cover(""),
    refused: () => get(`${BASE}/view`).then(listen, ended),
  });
  stream.open(`${BASE}/events`);
}

/** The view was closed, or the server is gone for good. */
function ended(error) {
  if (error.status === 404) cover(error.message);
  else setTimeout(listen, AGAIN);
}

function show({ integration, names, stage, theme: wanted }) {
  const of = names ? names.join(" and ") : integration ? pair(integration) : "";
  text(byId("what"), stage === "map" ? "the merged map" : [of, stage].filter(Boolean).join(", "));
  if (wanted !== theme) dress(wanted);
}

/** As the person who is followed has it; a scene that was loaded dark stays so until it is loaded again. */
function dress(wanted) {
  const scene = byId("scene");
  document.documentElement.style.colorScheme = theme = wanted;
  if (wanted === "light" && scene.src.endsWith("?darkMode")) scene.src = scene.src.replace("?darkMode", "");
}

function cover(sentence) {
  byId("cover").hidden = !sentence;
  text(byId("cover-text"), sentence);
}
