// Light, dark, or as the system has it: kept by this browser, for the pages, the scene and the player alike.

import { icon, set } from "./dom.js";

const KEY = "segmap.appearance";
const CHOICES = ["system", "light", "dark"];
const WORDS = { system: "as the system has them", light: "light", dark: "dark" };
const ICONS = { system: "contrast", light: "sun", dark: "moon" };
const SYSTEM = matchMedia("(prefers-color-scheme: dark)");
const ROOT = document.documentElement;
const changes = new EventTarget();

/** Whether the page is dark at the moment. */
export const dark = () => (ROOT.dataset.theme ? ROOT.dataset.theme === "dark" : SYSTEM.matches);

/** Call back whenever the page becomes light or dark. */
export function watch(changed) {
  let was = dark();
  const look = () => dark() !== was && ((was = dark()), changed());
  SYSTEM.addEventListener("change", look);
  changes.addEventListener("chosen", look);
}

/** Make a button go from one choice to the next; another tab follows. */
export function appearance(button) {
  button.addEventListener("click", () => choose(following(), true));
  addEventListener("storage", ({ key, newValue }) => key === KEY && choose(newValue));
  changes.addEventListener("chosen", () => show(button));
  show(button);
}

const chosen = () => ROOT.dataset.theme ?? "system";
const following = () => CHOICES[(CHOICES.indexOf(chosen()) + 1) % CHOICES.length];

function choose(choice, kept = false) {
  if (choice === "light" || choice === "dark") ROOT.dataset.theme = choice;
  else delete ROOT.dataset.theme;
  if (kept) keep(choice);
  changes.dispatchEvent(new Event("chosen"));
}

function show(button) {
  const says = `Colours: ${WORDS[chosen()]}. Press for: ${WORDS[following()]}`;
  button.title = says;
  set(button, "aria-label", says);
  button.replaceChildren(icon(ICONS[chosen()]));
}

/** A browser may forbid it; then the choice lasts as long as the page. */
function keep(choice) {
  try {
    localStorage.setItem(KEY, choice);
  } catch {
    return;
  }
}
