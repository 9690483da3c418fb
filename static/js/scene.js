// The scene in the middle: an iframe of our own address.

import { dark, watch } from "./appearance.js";
import { byId, text } from "./dom.js";
import { listen } from "./keys.js";

/** Show the scene of a view, each time the view is opened; `actions` answer the keys there as they do in the page. */
export function scene(view, actions) {
  const frame = byId("scene");
  view.addEventListener("opened", () => {
    cover("Loading the scene…");
    frame.src = dark() ? `${view.scene}?darkMode` : view.scene;
    theme(view);
  });
  watch(() => theme(view));
  frame.addEventListener("load", () => loaded(frame, actions));
}

let telling = Promise.resolve();

/** The colours of the scene follow the page; one is told after the other, so that the last one counts. */
function theme(view) {
  if (view.shared) return; // its colours are those of whoever shares it
  telling = telling
    .then(() => view.act("set_theme", dark() ? "dark" : "light"))
    .catch((error) => view.project.tell("trouble", error));
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
