// What goes into the project: its name, and logs that are added later.

import { described } from "./api.js";
import { byId } from "./dom.js";
import { count } from "./format.js";
import { rename } from "./keeping.js";
import { failed, notice } from "./notices.js";
import { sentence } from "./problems.js";

const TOLD = 3;

/** Make the name's button and the button of the logs work. */
export function inputs(project) {
  const files = byId("logs-files");
  byId("rename").addEventListener("click", () => rename({ id: project.id, name: project.info.name }, () => project.refreshInfo()));
  byId("logs-add").addEventListener("click", () => files.click());
  files.addEventListener("change", () => add(project, files));
}

async function add(project, files) {
  const button = byId("logs-add");
  if (!files.files.length) return;
  button.disabled = true;
  try {
    const added = await send(project, [...files.files]);
    notice([`Added ${added.logs.join(", ")}: ${count(added.scans, "scan")}.`, ...added.problems.slice(0, TOLD).map(sentence)].join(" "));
  } catch (error) {
    failed(error);
  }
  files.value = "";
  button.disabled = false;
  project.refresh();
}

async function send(project, files) {
  const body = new FormData();
  for (const file of files) body.append("files", file);
  const response = await fetch(`${project.url}/logs`, { method: "POST", body });
  const answer = await response.json().catch(() => null);
  if (!response.ok) throw described(response.status, answer);
  return answer;
}
