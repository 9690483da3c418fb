// Sheets that ask for one thing before something is done.

import { h, text } from "./dom.js";

/** Ask for a name and call `use(name)`; what goes wrong is said in the sheet, which stays open then. */
export function askName({ title, label, value = "", button, use }) {
  const input = h("input", { type: "text", value, required: true, maxlength: 200, autocomplete: "off", id: "ask-name" });
  const field = h("div.field", {}, h("label", { for: "ask-name" }, label), input);
  ask({ title, content: field, button, use: () => use(input.value.trim()) });
  input.select();
}

/** Ask whether something should really be done. */
export function askWhether({ title, sentence, button, use }) {
  ask({ title, content: h("p.field.muted", {}, sentence), button, use });
}

function ask({ title, content, button, use }) {
  const trouble = h("p.message.error", { role: "alert", hidden: true });
  const go = h("button.primary", { type: "submit" }, button);
  const cancel = h("button", { type: "button", onclick: () => dialog.close() }, "Cancel");
  const form = h("form", {}, h("h2", { id: "ask-title" }, title), content, trouble, h("div.row", {}, go, cancel));
  const dialog = h("dialog.sheet.small", { "aria-labelledby": "ask-title" }, form);
  dialog.addEventListener("close", () => dialog.remove());
  form.addEventListener("submit", (event) => (event.preventDefault(), submit(dialog, go, trouble, use)));
  document.body.append(dialog);
  dialog.showModal();
}

async function submit(dialog, go, trouble, use) {
  go.disabled = true;
  try {
    await use();
    dialog.close();
  } catch (error) {
    trouble.hidden = false;
    text(trouble, error.message);
    go.disabled = false;
  }
}
