// The export menu: a list of links that save files, and say why when there is nothing to save.

import { file, get } from "./api.js";
import { byId, h } from "./dom.js";
import { menu } from "./menu.js";
import { failed, notice } from "./notices.js";

/** Make the menu work for a project: every format the server writes, and what the page itself lists. */
export async function exportMenu(project) {
  const box = menu(byId("export"));
  box.addEventListener("click", chosen);
  const point = (link) => (link.href = `${project.url}/${link.dataset.path}`);
  box.querySelectorAll("a").forEach(point);
  try {
    const { formats } = await get("/api/exports");
    box.querySelector("ul").prepend(...formats.map(item));
    box.querySelectorAll("a").forEach(point);
  } catch (error) {
    failed(error);
  }
}

function item({ name, title, holds, use }) {
  return h("li", {}, h("a", { "data-path": `export/${name}` }, `${holds}, ${title}`, h("span.muted", {}, use)));
}

function chosen(event) {
  const link = event.target.closest("a");
  if (!link) return;
  event.preventDefault();
  save(link);
}

async function save(link) {
  try {
    const { blob, name } = await file(link.href);
    const url = URL.createObjectURL(blob);
    Object.assign(document.createElement("a"), { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 60000);
    notice(`Saved ${name}.`);
  } catch (error) {
    failed(error);
  }
}
