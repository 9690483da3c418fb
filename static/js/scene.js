// The scene in the middle: an iframe of our own address.

import { dark, watch } from "./appearance.js";
import { byId, text } from "./dom.js";
import { listen } from "./keys.js";

const FORCED = "?darkMode"; // viser's page is dark from the start, and stays so whatever it is told

/** Show the scene of a view, each time the view is opened; `actions` answer the keys there as they do in the page. */
export function scene(view, actions) {
  const frame = byId("scene");
  view.addEventListener("opened", () => {
    load(frame, view);
    theme(view);
  });
  watch(() => {
    theme(view);
    if (!dark() && frame.src.endsWith(FORCED)) load(frame, view);
  });
  frame.addEventListener("load", () => loaded(frame, actions));
}

/** Load it in the page's colours, so that it does not flash; those of a shared view are its owner's. */
function load(frame, view) {
  cover("Loading the scene…");
  frame.src = dark() && !view.shared ? view.scene + FORCED : view.scene;
}

/** The colours of the scene follow the page. */
function theme(view) {
  if (view.id === null || view.shared) return;
  view.act("set_theme", dark() ? "dark" : "light").catch((error) => view.project.tell("trouble", error));
}

/** Cover the scene with a sentence, or uncover it; `again` is offered as a button. */
export function cover(sentence, again = null) {
  byId("scene-cover").hidden = !sentence;
  byId("scene-again").hidden = !again;
  byId("scene-again").onclick = again;
  text(byId("scene-cover-text"), sentence);
}

/** The page answers the scene's keys, before the scene does: so that both do the same on the same list. */
function loaded(frame, actions) {
  const inside = frame.contentDocument;
  if (!inside || inside.URL === "about:blank") return;
  const there = inside.querySelector("#root, canvas");
  cover(there ? "" : "The scene could not be loaded.", there ? null : () => frame.contentWindow.location.reload());
  listen(actions, frame.contentWindow);
}
