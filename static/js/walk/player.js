// The player: any step of any stage, forwards and backwards, with the algorithm's lines and what each step says.

import { fill, h, text } from "../dom.js";
import { chart } from "./chart.js";
import { Figure } from "./figure.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const PAUSE = 1600;
const EVERY = "every step";
const CHOSEN = "chosen steps";

export class Player extends EventTarget {
  #walk;
  #load;
  #stage = null;
  #step = 0;
  #extra = new Map();
  #timer = 0;
  #asked = 0;
  #parts;

  /** `walk` is the overview; `load(stage, step)` gives a step; `open(stage)` a stage that is made when entered. */
  constructor(root, walk, { load, open = async () => null, enter = null }) {
    super();
    this.#walk = walk;
    this.#load = load;
    this.open = open;
    this.enterNode = enter;
    this.#parts = parts(this);
    fill(root, layout(this.#parts, walk));
    this.#stages();
    root.addEventListener("keydown", (event) => this.#key(event));
  }

  get playing() {
    return this.#timer !== 0;
  }

  get place() {
    return { stage: this.#stage?.id ?? "", step: this.#step };
  }

  /** The step that is shown, as it came from the library. */
  shown = null;

  /** Go to a step of a stage; `step` may be "last" or the label of a mark. */
  async go(id, step = 0) {
    const stage = await this.#find(id);
    if (!stage) return;
    const entered = stage !== this.#stage;
    this.#stage = stage;
    this.#step = Math.min(Math.max(0, numbered(stage, step)), stage.count - 1);
    if (entered) this.#enter();
    await this.#show();
  }

  async move(by) {
    const { count } = this.#stage;
    const to = this.#step + by;
    if (to < 0 || to >= count) return this.#over(by);
    return this.go(this.#stage.id, to);
  }

  /** Forwards over what is not worth stopping at. */
  async next() {
    const stops = this.#parts.which.value === CHOSEN ? this.#stage.stops : [];
    const to = stops.length ? stops.find((stop) => stop > this.#step) ?? this.#stage.count : this.#step + 1;
    return to < this.#stage.count ? this.go(this.#stage.id, to) : this.#over(1);
  }

  async previous() {
    const stops = this.#parts.which.value === CHOSEN ? this.#stage.stops : [];
    const before = stops.filter((stop) => stop < this.#step);
    return stops.length && before.length ? this.go(this.#stage.id, before.at(-1)) : this.move(-1);
  }

  play() {
    if (this.playing) return this.pause();
    pressed(this.#parts.play, true);
    const tick = async () => {
      const before = JSON.stringify(this.place);
      await this.next();
      if (!this.playing) return;
      if (before === JSON.stringify(this.place)) return this.pause();
      this.#timer = setTimeout(tick, PAUSE / SPEEDS[this.#parts.speed.value]);
    };
    this.#timer = setTimeout(tick, PAUSE / SPEEDS[this.#parts.speed.value] / 4);
  }

  pause() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    pressed(this.#parts.play, false);
  }

  async #find(id) {
    const known = this.#walk.stages.find((stage) => stage.id === id) ?? this.#extra.get(id);
    if (known) return known;
    const opened = await this.open(id);
    if (opened) this.#extra.set(id, opened);
    return opened;
  }

  /** Beyond the first or the last step of a stage: on into its neighbour. */
  async #over(by) {
    const { stages } = this.#walk;
    const here = stages.findIndex((stage) => stage.id === this.#stage.id);
    const there = here < 0 ? null : stages[here + by];
    if (there) await this.go(there.id, by > 0 ? 0 : "last");
  }

  #enter() {
    const stage = this.#stage;
    const { lines, title } = this.#walk.algorithms[stage.algorithm];
    text(this.#parts.title, stage.title);
    text(this.#parts.about, stage.about);
    text(this.#parts.paper, stage.figure ? `The paper's ${stage.figure}, drawn on these data` : "");
    text(this.#parts.algorithm, title);
    fill(this.#parts.lines, lines.map(line));
    Object.assign(this.#parts.slider, { max: stage.count - 1 });
    this.#parts.which.hidden = !stage.stops.length;
    fill(this.#parts.marks, h("option", { value: "" }, "Jump to…"), stage.marks.map(mark));
    this.#stages();
  }

  #stages() {
    const items = this.#walk.stages.map((stage, number) => {
      const current = stage.id === this.#stage?.id;
      const steps = h("span.muted.number", {}, String(stage.count));
      const go = () => this.go(stage.id, 0);
      const button = h("button.stage", { type: "button", onclick: go, "aria-current": current ? "step" : null, "data-stage": stage.id });
      button.append(h("span.place", {}, String(number + 1)), h("span", {}, stage.title), steps);
      return h("li", {}, button);
    });
    fill(this.#parts.stages, items);
  }

  async #show() {
    const asked = ++this.#asked;
    const [stage, number] = [this.#stage, this.#step];
    const step = await this.#load(stage, number);
    if (asked !== this.#asked) return;
    this.shown = step;
    const held = this.#parts;
    text(held.say, step.say);
    held.figure.show(step.shapes, this.#walk.base, step.box ?? stage.box ?? [-5, -5, 5, 5]);
    fill(held.quantities, step.quantities.map(quantity));
    this.#charts(stage, step);
    for (const row of held.lines.children) row.toggleAttribute("data-current", row.dataset.number === step.line);
    requestAnimationFrame(() => show(held.lines, held.lines.querySelector("[data-current]")));
    Object.assign(held.slider, { value: number });
    text(held.count, `${number + 1} / ${stage.count}`);
    held.entered.hidden = !step.enter;
    text(held.entered, step.enter?.label ?? "");
    this.dispatchEvent(new CustomEvent("step", { detail: { stage: stage.id, step: number } }));
  }

  #charts(stage, step) {
    const go = (to) => this.go(stage.id, to);
    const drawn = [stage.chart && chart(stage.chart, step.at, go), step.chart && chart(step.chart, step.at, go)];
    fill(this.#parts.charts, drawn);
  }

  enter() {
    const { stage, node } = this.shown?.enter ?? {};
    if (stage) this.go(stage, 0);
    else if (node !== undefined) this.enterNode?.(node);
  }

  #key(event) {
    if (event.target.closest("input:not(.steps), select, textarea")) return;
    const actions = { " ": () => this.play(), ArrowRight: () => this.move(1), ArrowLeft: () => this.move(-1) };
    Object.assign(actions, { "]": () => this.next(), "[": () => this.previous() });
    const action = event.ctrlKey || event.metaKey || event.altKey ? null : actions[event.key];
    if (!action || (event.key === " " && event.target.closest("button"))) return;
    event.preventDefault();
    action();
  }
}

function parts(player) {
  const figure = new Figure("The step as a picture, to scale");
  const button = (label, what, run) => h("button", { type: "button", title: what, "aria-label": what, onclick: run }, label);
  const speed = h("input", { type: "range", min: 0, max: SPEEDS.length - 1, value: 2, "aria-label": "Speed" });
  const slider = h("input.steps", { type: "range", min: 0, value: 0, "aria-label": "Step" });
  slider.addEventListener("input", () => player.go(player.place.stage, Number(slider.value)));
  const marks = h("select", { "aria-label": "Jump to a moment" });
  marks.addEventListener("change", () => (player.go(player.place.stage, Number(marks.value)), (marks.value = "")));
  const which = h("select", { "aria-label": "Play" }, h("option", {}, CHOSEN), h("option", {}, EVERY));
  return {
    figure, speed, slider, marks, which,
    stages: h("ol.stages", { "aria-label": "Stages" }),
    title: h("h2"), about: h("p.about"), paper: h("p.paper"),
    say: h("p.say", { role: "status", "aria-live": "polite" }),
    quantities: h("dl.quantities", { "aria-label": "Quantities of this line" }),
    algorithm: h("h3"), lines: h("ol.lines", { "aria-label": "Lines of the algorithm", tabindex: 0 }),
    charts: h("div.charts"), count: h("span.number.count"),
    entered: h("button.enter", { type: "button", hidden: true, onclick: () => player.enter() }),
    back: button("◀", "One step back (left arrow)", () => (player.pause(), player.move(-1))),
    play: button("▶ Play", "Play or pause (space)", () => player.play()),
    on: button("▶", "One step on (right arrow)", () => (player.pause(), player.move(1))),
    skipBack: button("◀◀", "Back to the chosen step before ([)", () => (player.pause(), player.previous())),
    skipOn: button("▶▶", "On to the next chosen step (])", () => (player.pause(), player.next())),
  };
}

function layout(p, walk) {
  const controls = [p.skipBack, p.back, p.play, p.on, p.skipOn, p.which, h("label.speed", {}, "Speed ", p.speed), p.marks, p.count];
  return [
    h("nav.walk-stages", { "aria-label": "Stages of the run" }, h("p.walk-title", {}, walk.title), p.stages),
    h("section.walk-picture", { "aria-label": "Picture" }, p.figure.element, h("div.controls", {}, p.slider, h("div.buttons", {}, controls))),
    words(p),
  ];
}

/** What happens at the step, beside the lines of the algorithm. */
function words(p) {
  const told = [p.title, p.about, p.say, p.entered, p.quantities, p.charts, p.paper];
  return h("section.walk-words", { "aria-label": "What happens" }, h("div.walk-told", {}, told), p.algorithm, p.lines);
}

function line({ number, text: words, indent }) {
  return h("li", { "data-number": number, "data-indent": indent }, h("span.line-number", {}, number), h("span.line-text", {}, words));
}

function mark([index, label]) {
  return h("option", { value: index }, label);
}

function quantity([name, value, unit]) {
  return h("div", {}, h("dt", {}, name), h("dd.number", {}, unit ? `${value} ${unit}` : value));
}

/** Bring a line into sight within its list, and nothing else. */
function show(list, current) {
  if (!current) return;
  const [top, bottom] = [current.offsetTop - list.offsetTop, current.offsetTop - list.offsetTop + current.offsetHeight];
  if (top < list.scrollTop) list.scrollTop = top - 30;
  else if (bottom > list.scrollTop + list.clientHeight) list.scrollTop = bottom - list.clientHeight + 30;
}

function numbered(stage, step) {
  if (step === "last") return stage.count - 1;
  const index = stage.marks.find(([, label]) => label === step)?.[0];
  return index ?? (Number.isFinite(Number(step)) ? Number(step) : 0);
}

function pressed(button, playing) {
  text(button, playing ? "❚❚ Pause" : "▶ Play");
  button.setAttribute("aria-pressed", String(playing));
}
