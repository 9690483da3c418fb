// The bar at the top: what the project is, how far the matching is, undo and redo in words.

import { appearance } from "./appearance.js";
import { byId, text } from "./dom.js";
import { count, whole } from "./format.js";
import { failed } from "./notices.js";

/** Keep the bar up to date and its buttons working. */
export function head(project, view) {
  appearance(byId("appearance"));
  for (const way of ["undo", "redo"]) byId(way).addEventListener("click", () => view.act(way).catch(failed));
  byId("matching-action").addEventListener("click", () => project.matching(byId("matching-action").value).catch(failed));
  project.addEventListener("info", () => information(project.info));
  project.addEventListener("progress", () => progress(project.info.progress));
}

function information(info) {
  document.title = `${info.name} – segmap`;
  text(byId("name"), info.name);
  const scans = info.logs.reduce((sum, log) => sum + log.scans, 0);
  text(byId("holds"), `${count(scans, "scan")}, ${count(info.counts.total, "integration")}`);
  history("undo", "Undo", info.undo);
  history("redo", "Redo", info.redo);
}

function history(id, word, what) {
  const button = byId(id);
  button.disabled = !what;
  button.title = what ? `${word}: ${what}` : `Nothing to ${word.toLowerCase()}`;
  button.setAttribute("aria-label", button.title);
  text(button.querySelector(".what"), what ?? "");
}

function progress({ done, total, cancelled, message }) {
  byId("matching").hidden = done >= total;
  if (done >= total) return;
  Object.assign(byId("matching-bar"), { max: Math.max(1, total), value: done });
  text(byId("matching-text"), message || `Matching: ${whole(done)} of ${whole(total)}`);
  byId("matching-action").value = cancelled ? "resume" : "cancel";
  text(byId("matching-action"), cancelled ? "Resume" : "Cancel");
}
