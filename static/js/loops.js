// Loop closures: search for them, import another program's pose graph, ask for a pair by hand.

import { ApiError, described } from "./api.js";
import { byId, text } from "./dom.js";
import { failed, notice } from "./notices.js";

const PAIR = /^\s*(?:(\d+)\.)?(\d+)\s*$/;

/** Make the menu work, and show how far a search is. */
export function loops(project, view) {
  const menu = byId("loops");
  const close = () => (menu.open = false);
  document.addEventListener("click", (event) => menu.contains(event.target) || close());
  menu.addEventListener("keydown", (event) => event.key === "Escape" && (close(), menu.querySelector("summary").focus()));
  byId("loops-search").addEventListener("click", () => (close(), project.search("start").catch(failed)));
  byId("searching-cancel").addEventListener("click", () => project.search("cancel").catch(failed));
  byId("loops-pair").addEventListener("click", () => (close(), ask(project, view)));
  byId("loops-import").addEventListener("click", () => (close(), byId("graph-file").click()));
  byId("graph-file").addEventListener("change", (event) => take(project, event.target.files));
  drop(project);
  project.addEventListener("search", () => progress(project.info.search));
  project.addEventListener("searched", ({ detail }) => notice(detail));
}

function progress({ running, done, total, message }) {
  byId("searching").hidden = !running;
  byId("loops-search").disabled = running;
  if (!running) return;
  const bar = byId("searching-bar");
  bar.max = Math.max(1, total);
  if (total) bar.value = done;
  else bar.removeAttribute("value");
  text(byId("searching-text"), message);
}

/** Ask for two scans, and put their pair into the queue. */
function ask(project, view) {
  const dialog = byId("pair");
  byId("pair-error").hidden = true;
  dialog.showModal();
  byId("pair-cancel").onclick = () => dialog.close();
  byId("pair-form").onsubmit = async (event) => {
    event.preventDefault();
    try {
      const id = integration(byId("pair-first").value, byId("pair-second").value);
      await project.addPairs([id]);
      dialog.close();
      await project.load();
      view.select(id);
    } catch (error) {
      byId("pair-error").hidden = false;
      text(byId("pair-error"), error.message);
    }
  };
}

/** The id of the pair of two scans, the earlier one first: "12" is short for "0.12". */
function integration(first, second) {
  const scans = [first, second].map((words) => PAIR.exec(words));
  if (scans.includes(null)) throw new ApiError("Write each scan as its number, or as log and number: 12, or 0.12.");
  const [a, b] = scans.map(([, log, scan]) => [Number(log ?? 0), Number(scan)]).sort((x, y) => x[0] - y[0] || x[1] - y[1]);
  return `${a.join(".")}-${b.join(".")}`;
}

/** A pose graph dropped anywhere on the page is imported. */
function drop(project) {
  const over = (event) => event.dataTransfer?.types.includes("Files") && event.preventDefault();
  for (const kind of ["dragenter", "dragover"]) document.addEventListener(kind, over);
  document.addEventListener("drop", (event) => {
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    take(project, event.dataTransfer.files);
  });
}

async function take(project, files) {
  for (const file of [...files]) {
    try {
      notice(await send(project, file));
    } catch (error) {
      failed(error);
    }
  }
  byId("graph-file").value = "";
  project.refresh();
}

async function send(project, file) {
  const body = new FormData();
  body.append("file", file);
  const response = await fetch(`${project.url}/graph`, { method: "POST", body });
  const answer = await response.json().catch(() => null);
  if (!response.ok) throw described(response.status, answer);
  return [answer.message, ...answer.problems.slice(0, 3)].join(" ");
}
