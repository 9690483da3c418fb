// Who decides, and why: the name is kept in this browser, the reason goes with one decision.

import { byId } from "./dom.js";
import { failed } from "./notices.js";

const KEY = "segmap-reviewer";
const PAUSE = 200;

/** The name that is stored with every decision made here. */
export function reviewer(project, view) {
  const field = byId("who");
  field.value = remembered();
  const send = () => view.id !== null && view.act("set_who", field.value).catch(failed);
  field.addEventListener("change", () => (keep(field.value), send()));
  field.addEventListener("keydown", (event) => event.key === "Enter" && byId("queue").focus());
  view.addEventListener("opened", () => field.value && send());
}

/** The reason of the next decision; typing it changes nothing else, Enter leads back to the queue. */
export function reasons(project, view) {
  const field = byId("reason");
  let timer = 0;
  const send = () => {
    clearTimeout(timer);
    if (field.value !== (view.snapshot.reason ?? "")) view.act("set_reason", field.value).catch(failed);
  };
  field.addEventListener("input", () => (clearTimeout(timer), (timer = setTimeout(send, PAUSE))));
  field.addEventListener("change", send);
  field.addEventListener("keydown", (event) => event.key === "Enter" && (event.preventDefault(), send(), byId("queue").focus()));
  let shown = null;
  view.addEventListener("changed", () => {
    const moved = view.integration !== shown;
    shown = view.integration;
    if (moved || document.activeElement !== field) field.value = view.snapshot.reason ?? "";
  });
}

function remembered() {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return "";
  }
}

/** A browser may forbid it; then the name lasts as long as the page. */
function keep(name) {
  try {
    localStorage.setItem(KEY, name);
  } catch {
    return;
  }
}
