// The threshold: what it would flip is shown before it is let go; decisions in bulk above and below it.

import { byId, fill, h, text } from "./dom.js";
import { count, some, whole } from "./format.js";
import { failed, notice } from "./notices.js";

const PAUSE = 80;
const BINS = 48;
const MOST = 100000;
const NO_FLIPS = { passes: new Set(), fails: new Set() };

export class Threshold {
  #asking = null;
  #timer = 0;
  #flips = NO_FLIPS;

  constructor(project, view, queue) {
    Object.assign(this, { project, view, queue });
    this.slider = byId("threshold");
    this.exact = byId("threshold-exact");
    this.slider.addEventListener("input", () => this.#preview(Number(this.slider.value)));
    this.slider.addEventListener("change", () => this.#set(Number(this.slider.value)));
    this.exact.addEventListener("change", () => this.exact.checkValidity() && this.#set(Number(this.exact.value)));
    this.#bulk("accept-above", "accepted");
    this.#bulk("reject-below", "rejected");
    project.addEventListener("info", () => this.#moved());
    project.addEventListener("rows", () => this.#draw());
  }

  get value() {
    return this.#asking === null ? this.project.info.threshold : Number(this.slider.value);
  }

  /** The threshold of the project changed, by us or by somebody else; a slider that is held stays. */
  #moved() {
    if (this.#asking !== null) return;
    const { quantity, unit, step, maximum } = this.project.criterion;
    text(byId("threshold-title").firstElementChild, `Threshold of ${quantity}`);
    text(byId("threshold-unit"), unit);
    this.slider.step = step;
    this.exact.max = maximum ?? MOST;
    if (document.activeElement !== this.exact) this.exact.value = this.project.info.threshold.toFixed(2);
    this.#draw();
  }

  #draw() {
    if (!this.project.info) return;
    const found = this.project.rows.filter((row) => row.state !== "none").map((row) => this.project.quantity(row));
    const numbers = found.filter((number) => number !== null);
    if (this.#asking === null) this.slider.max = this.project.criterion.maximum ?? reach(numbers, this.project.info.threshold);
    this.slider.value = this.value;
    this.#histogram(numbers);
    this.#buttons();
  }

  #histogram(numbers) {
    const most = Number(this.slider.max);
    const bins = new Array(BINS).fill(0);
    for (const number of numbers) bins[Math.min(BINS - 1, Math.floor((number / most) * BINS))] += 1;
    const highest = Math.max(1, ...bins);
    const box = byId("threshold-histogram");
    while (box.children.length < BINS) box.append(h("i"));
    bins.forEach((number, index) => {
      box.children[index].style.height = number ? `${Math.max(8, 100 * Math.sqrt(number / highest))}%` : "0";
      box.children[index].className = ((index + 0.5) / BINS) * most > this.value ? "above" : "";
    });
  }

  #buttons() {
    const { above, below } = this.#sides();
    this.#button("accept-above", above.length, `Accept ${whole(above.length)} above`);
    this.#button("reject-below", below.length, `Reject ${whole(below.length)} below`);
  }

  /** Say, as long as the button is pointed at, or has the keyboard, what it would decide. */
  #bulk(id, verdict) {
    const button = byId(id);
    button.addEventListener("click", () => this.#decide(verdict));
    for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => this.#foresee(verdict));
    for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => this.#asking === null && this.#unmark());
  }

  #foresee(verdict) {
    const ids = this.#sides()[verdict === "accepted" ? "above" : "below"];
    if (this.#asking !== null || ids.length === 0) return;
    const accepting = verdict === "accepted";
    const one = part(accepting ? "would-pass" : "would-fail", ids, accepting ? "would be accepted" : "would be rejected");
    fill(byId("bulk-preview"), one);
    const marked = new Set(ids);
    this.queue.preview({ passes: accepting ? marked : new Set(), fails: accepting ? new Set() : marked });
  }

  #unmark() {
    fill(byId("bulk-preview"));
    this.queue.preview(this.#flips);
  }

  #button(id, number, label) {
    text(byId(id).lastElementChild, label);
    byId(id).disabled = number === 0;
  }

  /** Undecided integrations the program would accept or reject under the threshold shown; the doubtful are in neither. */
  #sides() {
    const { passes, fails } = this.#flips;
    const accepted = (row) => passes.has(row.id) || (row.above && !fails.has(row.id));
    const rejected = (row) => row.verdict === "rejected" || (fails.has(row.id) && this.project.criterion.quantity === "value");
    const { undecided } = this.project;
    const above = undecided.filter(accepted);
    const below = undecided.filter((row) => !accepted(row) && rejected(row));
    return { above: above.map((row) => row.id), below: below.map((row) => row.id) };
  }

  #preview(value) {
    this.#asking?.abort();
    this.#asking = new AbortController();
    this.exact.value = value.toFixed(2);
    this.#draw();
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#ask(value, this.#asking), PAUSE);
  }

  async #ask(value, asking) {
    try {
      const flips = await this.project.flips(value, asking.signal);
      if (asking === this.#asking) this.#show(flips.would_pass, flips.would_fail);
    } catch (error) {
      failed(error);
    }
  }

  #show(passes, fails) {
    const parts = [part("would-pass", passes, "would pass"), part("would-fail", fails, "would no longer pass")].filter(Boolean);
    fill(byId("threshold-preview"), parts.length ? parts : "No undecided integration would flip.");
    this.#flip(passes, fails);
  }

  #flip(passes, fails) {
    this.#flips = { passes: new Set(passes), fails: new Set(fails) };
    this.queue.preview(this.#flips);
    this.#buttons();
  }

  async #set(value) {
    this.#release();
    if (value === this.project.info.threshold) return this.#moved();
    this.project.info.threshold = value;
    try {
      await this.project.setParameters({ changes: { [this.project.criterion.parameter]: value } });
    } catch (error) {
      failed(error);
    }
    return this.#moved();
  }

  #release() {
    clearTimeout(this.#timer);
    this.#asking?.abort();
    this.#asking = null;
    fill(byId("threshold-preview"));
    this.#flip([], []);
  }

  async #decide(verdict) {
    const { above, below } = this.#sides();
    const ids = verdict === "accepted" ? above : below;
    try {
      await this.view.decideMany(ids, verdict);
      this.#unmark();
      const word = verdict === "accepted" ? "Accepted" : "Rejected";
      notice(`${word} ${count(ids.length, "integration")}.`, { action: { label: "Undo", run: () => this.view.act("undo").catch(failed) } });
    } catch (error) {
      failed(error);
    }
  }
}

/** The right end of the slider: past the threshold, and past all but the highest few values. */
function reach(values, threshold) {
  const sorted = values.sort((a, b) => a - b);
  const high = sorted[Math.floor(0.95 * (sorted.length - 1))] ?? 0;
  return Math.ceil(Math.max(2 * threshold, high, 1));
}

function part(kind, ids, words) {
  return ids.length ? h(`p.${kind}`, {}, h("strong", {}, `${whole(ids.length)} ${words}`), `: ${some(ids)}`) : null;
}
