// Short messages at the foot of the page; errors stay until they are closed.

import { h, icon, text } from "./dom.js";

const STAY = 6000;
const MOST = 4;
let region = null;

/** Say something; `action` is {label, run} for one button beside it. */
export function notice(message, { kind = "info", action = null } = {}) {
  const item = h(`div.notice.${kind}`, { role: kind === "error" ? "alert" : "status" }, h("p", {}, message));
  if (action) item.append(h("button.quiet", { type: "button", onclick: () => (item.remove(), action.run()) }, action.label));
  item.append(h("button.quiet.square", { type: "button", "aria-label": "Close this message", onclick: () => item.remove() }, icon("close")));
  place(item);
  if (kind !== "error") setTimeout(() => item.remove(), STAY);
  return item;
}

/** Tell of an error; the same sentence is not shown twice. */
export function failed(error) {
  if (error?.name === "AbortError") return;
  const message = error?.message ?? String(error);
  if (!shown().some((item) => item.firstElementChild.textContent === message)) notice(message, { kind: "error" });
}

/** A sentence for screen readers only. */
export function announce(message) {
  text(document.getElementById("announcer"), message);
}

function place(item) {
  if (!region) {
    region = h("div.notices", { "aria-label": "Messages", role: "region" });
    document.body.append(region);
  }
  region.append(item);
  shown().slice(0, -MOST).forEach((old) => old.remove());
}

function shown() {
  return region ? [...region.children] : [];
}
