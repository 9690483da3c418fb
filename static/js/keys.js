// Hotkeys, the same ones as in the scene, and the sheet that lists them.

import { fill, h } from "./dom.js";

/** Keys by group: [keys, what they do, name of the action]. W A S D Q E and the arrows move the scene's camera. */
export const KEYS = [
  ["Integrations", [
    ["J", "next in the queue", "next"],
    ["K", "previous in the queue", "previous"],
    ["L", "skip: decide later", "skip"],
    ["Enter", "from the queue to its candidates", "enter"],
    ["/", "search the queue", "search"],
  ]],
  ["Candidates and heuristics", [
    ["N", "next candidate", "next_candidate"],
    ["P", "previous candidate", "previous_candidate"],
    ["H", "next heuristic", "next_heuristic"],
    ["Shift+H", "previous heuristic", "previous_heuristic"],
  ]],
  ["Decide", [
    ["Y", "accept", "accept"],
    ["X", "reject", "reject"],
    ["C", "say why: a reason kept with the decision", "reason"],
    ["G", "lay the second scan by hand, or stop", "toggle_nudging"],
    ["U", "undo", "undo"],
    ["R", "redo", "redo"],
  ]],
  ["Scene", [
    ["T", "next stage", "next_stage"],
    ["Shift+T", "previous stage", "previous_stage"],
    ["1–6", "a stage by its number", "stage"],
    ["V", "2D or 3D", "toggle_dimension"],
    ["F", "fit everything into the window", "fit"],
    ["M", "measure between two clicks", "toggle_measuring"],
    ["Escape", "from anywhere back to the queue", "queue"],
    ["?", "this sheet", "help"],
  ]],
];

/** Call `actions[name]()` on its key, except while somebody types or a dialogue is open; `root` is a window. */
export function listen(actions, root = window) {
  const names = new Map(KEYS.flatMap(([, keys]) => keys.map(([key, , name]) => [key, name])));
  const hear = (event) => {
    if (typing(event)) return;
    const name = names.get(pressed(event));
    if (!actions[name] || LOCAL.has(name)) return;
    event.preventDefault();
    if (root !== window) event.stopImmediatePropagation();
    if (!(event.repeat && DELIBERATE.has(name))) actions[name](event.key);
  };
  root.addEventListener("keydown", hear, root !== window);
}

const CAMERA =
  "The keys do the same wherever you are, in the page and in the scene. In the scene W A S D Q E and the arrows move the camera; " +
  "drag to pan, scroll to zoom, click a segment to see what it adds.";
const DELIBERATE = new Set(["accept", "reject", "undo", "redo", "skip", "toggle_nudging"]);
/** Those that the queue itself answers. */
const LOCAL = new Set(["enter"]);

/** Fill the help sheet. */
export function sheet(dialog) {
  const groups = KEYS.map(([title, keys]) => h("section", {}, h("h3", {}, title), h("dl", {}, keys.map(line))));
  const close = h("button.primary", { type: "button", autofocus: true, onclick: () => dialog.close() }, "Close");
  fill(dialog, h("h2", { id: "help-title" }, "Keyboard"), h("div.groups", {}, groups), h("p.muted", {}, CAMERA), close);
}

function line([key, what]) {
  const parts = key.split("+").map((part) => h("kbd", {}, part));
  return h("div", {}, h("dt", {}, parts), h("dd", {}, what));
}

function pressed(event) {
  if (/^[1-6]$/.test(event.key)) return "1–6";
  const letter = event.key.length === 1 ? event.key.toUpperCase() : event.key;
  return event.shiftKey && /^[A-Z]$/.test(letter) ? `Shift+${letter}` : letter;
}

function typing(event) {
  const field = event.target.closest?.("input, select, textarea");
  const types = field && !["range", "checkbox", "button"].includes(field.type);
  return types || event.ctrlKey || event.metaKey || event.altKey || event.isComposing || document.querySelector("dialog:modal") !== null;
}
