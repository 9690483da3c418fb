// The parameters: one form made of what the server says of each (unit, bounds, help).

import { get } from "./api.js";
import { byId, fill, h, set, text } from "./dom.js";
import { count, duration, pair, whole } from "./format.js";

export class ParameterDrawer {
  #fields = new Map();
  #presets = {};

  #tried = null;
  #trying = false;
  #again = false;

  constructor(project, view) {
    Object.assign(this, { project, view });
    this.dialog = byId("parameters");
    this.form = byId("parameters-form");
    byId("parameters-open").addEventListener("click", () => this.toggle());
    byId("parameters-close").addEventListener("click", () => this.dialog.close());
    this.dialog.addEventListener("close", () => (this.#putBack(), byId("parameters-open").focus()));
    view.addEventListener("changed", () => this.#told());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.dialog.open && this.dialog.close());
    this.form.addEventListener("input", () => this.#changed());
    this.form.addEventListener("submit", (event) => (event.preventDefault(), this.#apply()));
    byId("parameters-preset").addEventListener("change", (event) => this.#take(this.#presets[event.target.value]));
    byId("parameters-revert").addEventListener("click", () => (this.#fill(), this.#putBack()));
    project.addEventListener("info", () => this.dialog.open && this.#number() === 0 && this.#fill());
  }

  async toggle() {
    if (this.dialog.open) return this.dialog.close();
    if (this.#fields.size === 0) await this.#make();
    this.#fill();
    this.dialog.show();
    return byId("parameters-close").focus();
  }

  async #make() {
    const { parameters, presets } = await get("/api/parameters");
    this.#presets = presets;
    fill(byId("parameters-preset"), h("option", { value: "" }, "Values of a preset…"), options(Object.keys(presets)));
    fill(byId("parameters-list"), parameters.map((parameter) => this.#field(parameter)));
  }

  #field(parameter) {
    const id = `parameter-${parameter.name}`;
    const input = control(parameter, id);
    const slider = slide(parameter, id, input);
    this.#fields.set(parameter.name, { parameter, input, slider });
    const label = h("label", { for: id, title: parameter.name }, words(parameter.name));
    const box = h("div.control", {}, slider, input, parameter.unit && h("span.unit", {}, parameter.unit));
    const help = h("p.help", { id: `${id}-help` }, parameter.help, " ", h("span.bounds", {}, bounds(parameter)));
    return h("li", { "data-name": parameter.name }, label, box, help);
  }

  #fill() {
    const { parameters, mode, modes, heuristic, heuristics } = this.project.info;
    this.#take(parameters);
    fill(byId("parameters-mode"), options(modes)).value = mode;
    fill(byId("parameters-heuristic"), options(heuristics)).value = heuristic;
    byId("parameters-preset").value = "";
    this.#complain("");
    this.#changed();
  }

  #take(values) {
    for (const [name, value] of Object.entries(values ?? {})) {
      const field = this.#fields.get(name);
      if (field) write(field, value);
    }
    this.#changed();
  }

  /** What the form says that the project does not. */
  #changes() {
    const changes = new Map();
    for (const [name, field] of this.#fields) {
      const value = read(field);
      if (value !== this.project.info.parameters[name]) changes.set(name, value);
    }
    return changes;
  }

  /** Another mode, which brings its own heuristic, or another heuristic of this mode. */
  #method() {
    const [mode, heuristic] = [byId("parameters-mode").value, byId("parameters-heuristic").value];
    if (mode !== this.project.info.mode) return { mode };
    return heuristic === this.project.info.heuristic ? {} : { heuristic };
  }

  #number() {
    return this.#changes().size + Object.keys(this.#method()).length;
  }

  #changed() {
    const changes = this.#changes();
    for (const [name, { input }] of this.#fields) set(input.closest("li"), "data-changed", changes.has(name));
    byId("parameters-heuristic").disabled = byId("parameters-mode").value !== this.project.info.mode;
    const number = this.#number();
    text(byId("parameters-apply"), number ? `Apply ${count(number, "change")}` : "Apply");
    for (const id of ["parameters-apply", "parameters-revert"]) byId(id).disabled = number === 0;
    this.#try();
  }

  /** Show on the selected pair what the form says; while one answer is awaited only the newest change waits too. */
  async #try() {
    this.#again = true;
    if (this.#trying || !this.dialog.open) return;
    this.#trying = true;
    while (this.#again) {
      this.#again = false;
      await this.#tryOnce().catch((error) => this.#complain(error.message));
    }
    this.#trying = false;
  }

  async #tryOnce() {
    const changes = this.#changes();
    const wanted = changes.size && this.form.checkValidity() ? Object.fromEntries(changes) : null;
    if (wanted === null && !this.view.snapshot.trial) return;
    await this.view.act("try_parameters", wanted);
    this.#complain("");
  }

  #putBack() {
    this.#again = false;
    if (this.view.snapshot.trial) this.view.act("try_parameters").catch((error) => this.project.tell("trouble", error));
  }

  /** Another pair: the same changes are tried on it. */
  #told() {
    const { trial, candidates, integration } = this.view.snapshot;
    if (this.dialog.open && integration !== this.#tried && this.#changes().size) this.#try();
    this.#tried = integration;
    const tried = () => [`${trial.segments.join(" × ")} segments`, count(candidates, "candidate"), duration(trial.milliseconds)].join(", ");
    const words = trial ? `Tried on ${pair(integration)}: ${tried()}.` : "Changes show on the selected pair as you make them.";
    text(byId("parameters-trial"), words);
  }

  async #apply() {
    try {
      await this.project.setParameters({ changes: Object.fromEntries(this.#changes()), ...this.#method(), who: byId("who").value });
      this.#putBack();
      await this.project.load();
      this.#fill();
    } catch (error) {
      this.#complain(error.message);
    }
  }

  #complain(message) {
    byId("parameters-error").hidden = !message;
    text(byId("parameters-error"), message);
  }
}

const options = (names) => names.map((name) => h("option", {}, name));

function control(parameter, id) {
  const shared = { id, name: parameter.name, "aria-describedby": `${id}-help` };
  if (parameter.kind === "boolean") return h("input", { type: "checkbox", ...shared });
  if (parameter.kind === "choice") return h("select", shared, options(parameter.choices));
  const limits = { min: parameter.minimum ?? parameter.above, max: parameter.maximum ?? parameter.below };
  const step = parameter.kind === "integer" ? 1 : "any";
  return h("input", { type: "number", step, placeholder: parameter.optional ? "none" : null, required: !parameter.optional, ...limits, ...shared });
}

/**
 * A slider beside a number, for the mouse (the number has the arrow keys): it moves the number, and the number moves it;
 * on a scale of ratios where bounds are far apart.
 */
function slide(parameter, id, input) {
  const low = parameter.minimum ?? parameter.above;
  const high = parameter.maximum ?? parameter.below;
  if (!["number", "integer"].includes(parameter.kind) || low === null || high === null || parameter.optional) return null;
  const scale = scaleOf(parameter, low, high);
  const slider = h("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-hidden": "true", tabindex: -1, "data-for": id });
  slider.addEventListener("input", () => (input.value = scale.value(Number(slider.value) / STEPS)));
  input.addEventListener("input", () => (slider.value = Math.round(STEPS * scale.share(Number(input.value)))));
  slider.follow = () => (slider.value = Math.round(STEPS * scale.share(Number(input.value))));
  return slider;
}

const STEPS = 200;
const FAR = 50;

function scaleOf(parameter, low, high) {
  const whole = parameter.kind === "integer";
  const rounded = (value) => (whole ? Math.round(value) : Number(value.toPrecision(3)));
  const standard = Number(parameter.default) || 1;
  const bottom = Math.max(low, standard / FAR);
  const top = Math.min(high, standard * FAR);
  const inside = (value) => Math.min(high, Math.max(low, value));
  if (bottom <= 0 || top / bottom < FAR) {
    return { value: (share) => rounded(inside(low + share * (high - low))), share: (value) => clamp((value - low) / (high - low)) };
  }
  const ratio = Math.log(top / bottom);
  return { value: (share) => rounded(inside(bottom * Math.exp(share * ratio))), share: (value) => clamp(Math.log(Math.max(value, bottom) / bottom) / ratio) };
}

const clamp = (share) => Math.min(1, Math.max(0, share));

function read({ parameter, input }) {
  if (parameter.kind === "boolean") return input.checked;
  if (parameter.kind === "choice") return input.value;
  return input.value === "" ? null : Number(input.value);
}

function write({ parameter, input, slider }, value) {
  if (parameter.kind === "boolean") input.checked = value;
  else input.value = value ?? "";
  slider?.follow();
}

const brief = (number) => (Number.isInteger(number) ? whole(number) : String(Number(number.toPrecision(4))));

function words(name) {
  const plain = name.replaceAll("_", " ");
  return plain[0].toUpperCase() + plain.slice(1);
}

function bounds({ default: standard, minimum, maximum, above, below, kind }) {
  if (kind === "boolean") return `Default ${standard ? "on" : "off"}.`;
  if (kind === "choice") return `Default ${standard}.`;
  const low = above !== null ? `above ${brief(above)}` : minimum !== null ? `from ${brief(minimum)}` : "";
  const high = below !== null ? `below ${brief(below)}` : maximum !== null ? `up to ${brief(maximum)}` : "";
  return `Default ${standard ?? "none"}; ${[low, high].filter(Boolean).join(", ")}.`;
}
