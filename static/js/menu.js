// Menus: a <details> that closes when one looks elsewhere, and is walked through with the arrows.

/** Make a details.menu behave as people know it. */
export function menu(details) {
  const summary = details.querySelector("summary");
  const close = () => (details.open = false);
  document.addEventListener("click", (event) => details.contains(event.target) || close());
  details.addEventListener("click", (event) => event.target.closest("a, li button") && close());
  details.addEventListener("focusout", (event) => event.relatedTarget && !details.contains(event.relatedTarget) && close());
  details.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && details.open) close(), summary.focus();
    else walk(event, details);
  });
  return details;
}

function walk(event, details) {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!step || !details.open) return;
  event.preventDefault();
  const items = [...details.querySelectorAll("li a, li button:not(:disabled)")];
  const at = items.indexOf(document.activeElement);
  items[at < 0 ? (step > 0 ? 0 : items.length - 1) : (at + step + items.length) % items.length]?.focus();
}
