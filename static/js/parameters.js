// The parameters: one form made of what the server says of each (unit, bounds, help).

import { get } from "./api.js";
import { byId, fill, h, set, text } from "./dom.js";
import { count, whole } from "./format.js";

export class ParameterDrawer {
  #fields = new Map();
  #presets = {};

  constructor(project) {
    this.project = project;
    this.dialog = byId("parameters");
    this.form = byId("parameters-form");
    byId("parameters-open").addEventListener("click", () => this.toggle());
    byId("parameters-close").addEventListener("click", () => this.dialog.close());
    this.dialog.addEventListener("close", () => byId("parameters-open").focus());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.dialog.open && this.dialog.close());
    this.form.addEventListener("input", () => this.#changed());
    this.form.addEventListener("submit", (event) => (event.preventDefault(), this.#apply()));
    byId("parameters-preset").addEventListener("change", (event) => this.#take(this.#presets[event.target.value]));
    byId("parameters-revert").addEventListener("click", () => this.#fill());
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
    this.#fields.set(parameter.name, { parameter, input });
    const label = h("label", { for: id, title: parameter.name }, words(parameter.name));
    const box = h("div.control", {}, input, parameter.unit && h("span.unit", {}, parameter.unit));
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
  }

  async #apply() {
    try {
      await this.project.setParameters({ changes: Object.fromEntries(this.#changes()), ...this.#method() });
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

function read({ parameter, input }) {
  if (parameter.kind === "boolean") return input.checked;
  if (parameter.kind === "choice") return input.value;
  return input.value === "" ? null : Number(input.value);
}

function write({ parameter, input }, value) {
  if (parameter.kind === "boolean") input.checked = value;
  else input.value = value ?? "";
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
