// Runs before anything is drawn, so that no page shows in the wrong colours first; appearance.js changes them.

try {
  const chosen = localStorage.getItem("segmap.appearance");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch {
  // a browser may forbid it: then the colours are the system's
}
