// The export menu: a list of links that save files, and say why when there is nothing to save.

import { file, get } from "./api.js";
import { byId, h } from "./dom.js";
import { failed, notice } from "./notices.js";

/** Make the menu work for a project: every format the server writes, and what the page itself lists. */
export async function exportMenu(project) {
  const menu = byId("export");
  menu.addEventListener("click", (event) => chosen(event, menu));
  document.addEventListener("click", (event) => menu.contains(event.target) || (menu.open = false));
  menu.addEventListener("keydown", (event) => key(event, menu));
  const point = (link) => (link.href = `${project.url}/${link.dataset.path}`);
  menu.querySelectorAll("a").forEach(point);
  try {
    const { formats } = await get("/api/exports");
    menu.querySelector("ul").prepend(...formats.map(item));
    menu.querySelectorAll("a").forEach(point);
  } catch (error) {
    failed(error);
  }
}

function item({ name, title, holds, use }) {
  return h("li", {}, h("a", { "data-path": `export/${name}` }, `${holds}, ${title}`, h("span.muted", {}, use)));
}

function chosen(event, menu) {
  const link = event.target.closest("a");
  if (!link) return;
  event.preventDefault();
  save(link, menu);
}

async function save(link, menu) {
  menu.open = false;
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

function key(event, menu) {
  const links = [...menu.querySelectorAll("a")];
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (event.key === "Escape") {
    menu.open = false;
    menu.querySelector("summary").focus();
  } else if (step && menu.open) {
    event.preventDefault();
    const at = links.indexOf(document.activeElement);
    links[(at + step + links.length) % links.length].focus();
  }
}
