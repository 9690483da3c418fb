// A list of thousands of rows, of which only those in sight are in the document.

import { h } from "./dom.js";

const BEYOND = 8;

/** Keyed rows of one height; `make()` gives an element, `draw(element, item)` shows an item in it. */
export class VirtualList {
  #items = [];
  #drawn = new Map();
  #spare = [];

  constructor(box, { height, make, draw, key }) {
    Object.assign(this, { box, height, make, draw, key });
    this.canvas = h("div.canvas", { role: "presentation" });
    box.append(this.canvas);
    box.addEventListener("scroll", () => this.#paint(false), { passive: true });
    new ResizeObserver(() => this.#paint(false)).observe(box);
  }

  /** Show other items; `anchor`, the key of one of them, keeps its place on the screen when it is in sight: except at
   *  the top of the list, where what comes first is what one wants to see. */
  show(items, anchor = null) {
    const before = this.#place(anchor);
    this.#items = items;
    this.canvas.style.height = `${items.length * this.height}px`;
    const after = this.#place(anchor);
    if (before !== null && after !== null && this.box.scrollTop > 0 && this.#inSight(before)) this.box.scrollTop += after - before;
    this.#paint(true);
  }

  /** Scroll just far enough that an item can be seen. */
  reveal(key) {
    const top = this.#place(key);
    if (top === null) return;
    const { scrollTop, clientHeight } = this.box;
    if (top < scrollTop) this.box.scrollTop = top;
    else if (top + this.height > scrollTop + clientHeight) this.box.scrollTop = top + this.height - clientHeight;
    this.#paint(false);
  }

  /** How many whole rows fit. */
  get fits() {
    return Math.max(1, Math.floor(this.box.clientHeight / this.height));
  }

  #place(key) {
    const index = key === null ? -1 : this.#items.findIndex((item) => this.key(item) === key);
    return index < 0 ? null : index * this.height;
  }

  #inSight(top) {
    return top + this.height > this.box.scrollTop && top < this.box.scrollTop + this.box.clientHeight;
  }

  #paint(redraw) {
    const first = Math.max(0, Math.floor(this.box.scrollTop / this.height) - BEYOND);
    const items = this.#items.slice(first, first + this.fits + 2 * BEYOND + 1);
    const wanted = new Set(items.map(this.key));
    for (const [key, element] of this.#drawn) if (!wanted.has(key)) this.#drop(key, element);
    items.forEach((item, index) => this.#put(item, first + index, redraw));
  }

  #put(item, index, redraw) {
    const key = this.key(item);
    const known = this.#drawn.get(key);
    const element = known ?? this.#take(key);
    element.style.transform = `translateY(${index * this.height}px)`;
    element.setAttribute("aria-posinset", index + 1);
    element.setAttribute("aria-setsize", this.#items.length);
    if (redraw || !known) this.draw(element, item);
  }

  #take(key) {
    const element = this.#spare.pop() ?? this.make();
    if (!element.isConnected) this.canvas.append(element);
    element.hidden = false;
    this.#drawn.set(key, element);
    return element;
  }

  #drop(key, element) {
    element.hidden = true;
    this.#drawn.delete(key);
    this.#spare.push(element);
  }
}
