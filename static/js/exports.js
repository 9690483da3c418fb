// The export menu: a list of links that save files, and say why when there is nothing to save.

import { file } from "./api.js";
import { byId } from "./dom.js";
import { failed, notice } from "./notices.js";

/** Make the menu work for a project. */
export function exportMenu(project) {
  const menu = byId("export");
  for (const link of menu.querySelectorAll("a")) {
    link.href = `${project.url}/${link.dataset.path}`;
    link.addEventListener("click", (event) => (event.preventDefault(), save(link, menu)));
  }
  document.addEventListener("click", (event) => menu.contains(event.target) || (menu.open = false));
  menu.addEventListener("keydown", (event) => key(event, menu));
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
