// The way from a project to the walkthrough of the pair that is selected.

import { byId } from "./dom.js";

/** Keep the link on the selected pair and on the heuristic that is shown. */
export function walkLink(project, view) {
  const link = byId("walk-open");
  view.addEventListener("changed", () => {
    const { integration, snapshot } = view;
    const asked = { project: project.id, ...(integration ? { pair: integration } : {}) };
    if (integration && snapshot.heuristic) asked.heuristic = snapshot.heuristic;
    link.href = `/walk?${new URLSearchParams(asked)}`;
  });
}
