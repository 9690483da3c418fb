// Sharing what one sees: a link for two to work in one view, and one for others to follow it.

import { post } from "./api.js";
import { byId, h } from "./dom.js";
import { failed, notice } from "./notices.js";

/** Make the sharing button work. */
export function sharing(project, view) {
  byId("share").addEventListener("click", () => share(view).catch(failed));
}

async function share(view) {
  const { steer, follow } = await post(`/api/views/${encodeURIComponent(view.id)}/share`);
  view.shared = true;
  history.replaceState(null, "", `${steer}${location.hash}`);
  const lines = [
    line("share-follow", "To look only", "Whoever opens it sees what you see, as you change it, and can change nothing. For a class.", follow),
    line("share-steer", "To work together", "Whoever opens it shares this view with you: both see the same, both may change it.", steer),
  ];
  const close = h("button.primary", { type: "button", onclick: () => dialog.close() }, "Close");
  const own = h("p.muted", {}, "The plain address of the project opens a view of one's own.");
  const dialog = h("dialog.sheet.share", { "aria-labelledby": "share-title" }, h("h2", { id: "share-title" }, "Share this view"), lines, own, close);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

function line(id, title, sentence, path) {
  const url = new URL(path, location.href).href;
  const field = h("input", { type: "text", id, readonly: true, value: url, onfocus: (event) => event.target.select() });
  const copy = h("button", { type: "button", "aria-label": `Copy the link: ${title}`, onclick: () => copied(field, url) }, "Copy");
  return h("div.field", {}, h("label", { for: id }, title), h("p.muted", {}, sentence), h("div.row", {}, field, copy));
}

/** Without a secure address there is no clipboard to write to: then the link is selected, to be copied by hand. */
async function copied(field, url) {
  field.select();
  try {
    await navigator.clipboard.writeText(url);
    notice("The link is copied.");
  } catch {
    notice("Copy the marked link with Ctrl+C.");
  }
}
