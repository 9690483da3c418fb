// The threshold: what it would flip is shown before it is let go; decisions in bulk above and below it.

import { byId, fill, h, text } from "./dom.js";
import { count, metres, some, whole } from "./format.js";
import { failed, notice } from "./notices.js";

const PAUSE = 80;
const BINS = 48;

export class Threshold {
  #asking = null;
  #timer = 0;

  constructor(project, queue) {
    Object.assign(this, { project, queue });
    this.slider = byId("threshold");
    this.exact = byId("threshold-exact");
    this.slider.addEventListener("input", () => this.#preview(Number(this.slider.value)));
    this.slider.addEventListener("change", () => this.#set(Number(this.slider.value)));
    this.exact.addEventListener("change", () => this.exact.checkValidity() && this.#set(Number(this.exact.value)));
    byId("accept-above").addEventListener("click", () => this.#decide("accepted"));
    byId("reject-below").addEventListener("click", () => this.#decide("rejected"));
    project.addEventListener("info", () => this.#moved());
    project.addEventListener("rows", () => this.#draw());
  }

  get value() {
    return this.#asking === null ? this.project.info.threshold : Number(this.slider.value);
  }

  /** The threshold of the project changed, by us or by somebody else; a slider that is held stays. */
  #moved() {
    if (this.#asking !== null) return;
    const { threshold } = this.project.info;
    this.slider.max = Math.max(2 * threshold, Number(this.slider.max));
    this.slider.value = threshold;
    if (document.activeElement !== this.exact) this.exact.value = threshold.toFixed(2);
    this.#draw();
  }

  #draw() {
    if (!this.project.info) return;
    const values = this.project.rows.filter((row) => row.state !== "none" && row.value > 0).map((row) => row.value);
    if (this.#asking === null) this.slider.max = reach(values, this.project.info.threshold);
    this.slider.value = this.value;
    this.#histogram(values);
    this.#buttons();
  }

  #histogram(values) {
    const most = Number(this.slider.max);
    const bins = new Array(BINS).fill(0);
    for (const value of values) bins[Math.min(BINS - 1, Math.floor((value / most) * BINS))] += 1;
    const highest = Math.max(1, ...bins);
    const box = byId("threshold-histogram");
    while (box.children.length < BINS) box.append(h("i"));
    bins.forEach((number, index) => {
      box.children[index].style.height = number ? `${Math.max(8, (100 * number) / highest)}%` : "0";
      box.children[index].className = ((index + 0.5) / BINS) * most > this.value ? "above" : "";
    });
  }

  #buttons() {
    const { above, below } = this.#sides();
    this.#button("accept-above", above.length, `Accept ${whole(above.length)} above`);
    this.#button("reject-below", below.length, `Reject ${whole(below.length)} below`);
  }

  #button(id, number, label) {
    text(byId(id).lastElementChild, label);
    byId(id).disabled = number === 0;
  }

  /** Undecided integrations with a transformation, on both sides of the value shown. */
  #sides() {
    const undecided = this.project.rows.filter((row) => row.state === "pending" && row.value !== null);
    const above = undecided.filter((row) => row.value > this.value).map((row) => row.id);
    return { above, below: undecided.filter((row) => row.value <= this.value).map((row) => row.id) };
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
      if (asking === this.#asking) this.#show(flips);
    } catch (error) {
      failed(error);
    }
  }

  #show({ would_pass: passes, would_fail: fails }) {
    const parts = [part("would-pass", passes, "would pass"), part("would-fail", fails, "would no longer pass")].filter(Boolean);
    fill(byId("threshold-preview"), parts.length ? parts : "No undecided integration would flip.");
    this.queue.preview(passes, fails);
  }

  async #set(value) {
    this.#release();
    if (value === this.project.info.threshold) return this.#moved();
    this.project.info.threshold = value;
    try {
      await this.project.setParameters({ changes: { value_threshold: value } });
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
    this.queue.preview([], []);
  }

  async #decide(verdict) {
    const { above, below } = this.#sides();
    const ids = verdict === "accepted" ? above : below;
    try {
      await this.project.decide(ids, verdict);
      const side = verdict === "accepted" ? "above" : "not above";
      const message = `${verdict === "accepted" ? "Accepted" : "Rejected"} ${count(ids.length, "integration")} ${side} ${metres(this.value)}.`;
      notice(message, { action: { label: "Undo", run: () => this.project.undo().catch(failed) } });
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
