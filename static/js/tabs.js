// Tabs with the keyboard behaviour people know: arrows move, the panel follows.

/** Make a role=tablist work; tabs name their panels by aria-controls. Returns show(name). */
export function tabs(list) {
  const all = [...list.querySelectorAll("[role=tab]")];
  const show = (tab, focus = false) => {
    for (const other of all) choose(other, other === tab);
    if (focus) tab.focus();
  };
  for (const tab of all) tab.addEventListener("click", () => show(tab));
  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const at = all.indexOf(document.activeElement);
    if (!step || at < 0) return;
    event.preventDefault();
    show(all[(at + step + all.length) % all.length], true);
  });
  return (name) => show(all.find((tab) => tab.id === name));
}

function choose(tab, chosen) {
  tab.setAttribute("aria-selected", String(chosen));
  tab.tabIndex = chosen ? 0 : -1;
  document.getElementById(tab.getAttribute("aria-controls")).hidden = !chosen;
}
