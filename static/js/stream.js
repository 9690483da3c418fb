// The one stream of events of a page.

const TYPES = ["match", "decision", "progress", "graph", "search", "map", "parameters", "later", "view", "log", "project", "deleted", "error"];
const AGAIN = 2000;

/** Listens to server-sent events, and goes on listening when the server has been away. */
export class Stream {
  #source = null;
  #timer = 0;
  #lost = false;

  /** `hear(event)`; `lost()` and `back()` for the connection; `refused()` some time after the server said no to it. */
  constructor({ hear, back, lost, refused }) {
    Object.assign(this, { hear, back, lost, refused });
  }

  open(url) {
    this.close();
    const source = new EventSource(url);
    const hear = (message) => message.data && this.hear(JSON.parse(message.data));
    source.addEventListener("message", hear);
    for (const type of TYPES) source.addEventListener(type, hear);
    source.addEventListener("open", () => this.#connected());
    source.addEventListener("error", (event) => event.data || this.#broken(source));
    this.#source = source;
  }

  close() {
    clearTimeout(this.#timer);
    this.#source?.close();
    this.#source = null;
  }

  #connected() {
    if (!this.#lost) return;
    this.#lost = false;
    this.back();
  }

  #broken(source) {
    if (source !== this.#source) return;
    if (!this.#lost) this.lost();
    this.#lost = true;
    if (source.readyState === EventSource.CLOSED) this.#timer = setTimeout(() => this.refused(), AGAIN);
  }
}
