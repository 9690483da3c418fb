// Heuristics against each other, and one parameter through its range, on the pair of the walkthrough.

import { get } from "../api.js";
import { fill, h } from "../dom.js";
import { duration, whole } from "../format.js";
import { chart } from "./chart.js";

const ROLE = { true: "good", false: "bad", null: "first" };
const SAID = { true: "right", false: "wrong", null: "–" };

/** A button that opens the race; `asked(more)` gives the question of a request. */
export function races(asked) {
  const dialog = h("dialog.sheet.races", { "aria-label": "Race and sweep" });
  const open = () => {
    document.body.append(dialog);
    if (!dialog.firstChild) begin(dialog, asked);
    dialog.showModal();
  };
  return h("button", { type: "button", id: "races-open", onclick: open }, "Race and sweep");
}

function begin(dialog, asked) {
  const race = h("section", { "aria-label": "Race of the heuristics" });
  const sweep = h("section", { "aria-label": "Sweep of a parameter" });
  const close = h("button.primary", { type: "button", onclick: () => dialog.close() }, "Close");
  fill(dialog, h("h2", {}, "Race and sweep"), race, sweep, close);
  load(race, () => get(`/api/walk/race?${asked()}`), raced);
  swept(sweep, asked, "point_distance_tolerance");
}

function swept(section, asked, parameter) {
  const again = (name) => swept(section, asked, name);
  load(section, () => get(`/api/walk/sweep?${asked({ parameter })}`), (told) => sweepOf(told, again));
}

async function load(section, ask, show) {
  fill(section, h("p.muted", { role: "status" }, "Matching…"));
  try {
    fill(section, ...show(await ask()));
  } catch (error) {
    fill(section, h("p.message.error", { role: "alert" }, error.message));
  }
}

function raced({ runs, truth }) {
  const points = runs.map((run) => ({ x: run.milliseconds, y: run.value, role: ROLE[run.right], label: run.heuristic }));
  const about = truth
    ? "Each dot is one heuristic: how long it took, and the value it found. Green is right, red is wrong: a high value alone does not make it right."
    : "Each dot is one heuristic: how long it took, and the value it found. The truth of this pair is not known.";
  const title = "Time and value of each heuristic";
  const drawn = chart({ kind: "dots", title, x: "milliseconds, logarithmic", y: "m", points, logarithmic: true });
  return [h("h3", {}, "The heuristics race"), h("p.muted", {}, about), drawn, table("heuristic", runs)];
}

function sweepOf({ parameter, unit, parameters, now, runs }, again) {
  const select = h("select", { "aria-label": "Parameter to sweep" });
  fill(select, parameters.map((name) => h("option", { value: name }, name)));
  select.value = parameter;
  select.addEventListener("change", () => again(select.value));
  const points = runs.map((run) => ({ x: Math.max(run.setting, 1e-4), y: run.value, role: ROLE[run.right] }));
  const x = `${parameter}${unit ? `, ${unit}` : ""}, logarithmic`;
  const drawn = chart({ kind: "dots", title: "Value of the best candidate", x, y: "m", points, logarithmic: true });
  const about = `Everything else stays as it is; now ${parameter} is ${now}${unit ? ` ${unit}` : ""}. Where is the answer right, and for how long?`;
  return [h("h3", {}, "One parameter through its range"), h("label", {}, "Parameter ", select), h("p.muted", {}, about), drawn, table(parameter, runs)];
}

function table(what, runs) {
  const cells = (run) => [run.label, whole(run.tries), duration(run.milliseconds), `${run.value.toFixed(2)} m`, run.verdict, SAID[run.right]];
  const head = [what, "tried", "time", "value", "verdict", "truth"].map((name) => h("th", { scope: "col" }, name));
  const rows = runs.map((run) => h("tr", { "data-right": String(run.right) }, cells(run).map((cell) => h("td", {}, cell))));
  return h("table.numbers", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, rows));
}
