// This page's view: what its scene shows. The server keeps it; the page asks for changes and mirrors the answer.

import { get, post } from "./api.js";
import { byId } from "./dom.js";

const SETTLE = 30;

/** Who decides at this page: several may work in one view. */
const name = () => byId("who").value.trim();

/** Tells "opened" (there is a new scene) and "changed" (the snapshot) as events. */
export class View extends EventTarget {
  #sending = 0;
  #queue = Promise.resolve();
  #heard = null;
  #wanted = null;

  constructor(project) {
    super();
    this.project = project;
    this.id = null;
    this.scene = null;
    this.shared = false;
    this.snapshot = {};
  }

  get integration() {
    return this.snapshot.integration ?? null;
  }

  async open(integration = this.integration) {
    const { id, scene } = await this.#opened();
    this.id = id;
    this.scene = scene;
    this.snapshot = { ...this.snapshot, serial: 0 };
    this.dispatchEvent(new Event("opened"));
    const known = integration && !this.shared && this.project.row(integration);
    this.apply(known ? await post(this.#url, { action: "select", value: integration }) : await get(this.#url));
  }

  /** The view somebody shares with us, as long as it is there; otherwise one of our own. */
  async #opened() {
    const id = new URLSearchParams(location.search).get("view");
    if (!id) return post(`${this.project.url}/views`);
    try {
      await get(`/api/views/${encodeURIComponent(id)}`);
      this.shared = true;
      return { id, scene: `/views/${encodeURIComponent(id)}/scene/` };
    } catch (error) {
      if (error.status !== 404) throw error;
      history.replaceState(null, "", location.pathname + location.hash);
      this.shared = false;
      return post(`${this.project.url}/views`);
    }
  }

  /** Ask for a change and show it; a view the server no longer has is opened again first. */
  async act(action, value = null) {
    const snapshot = await this.#send(action, value);
    if (this.#idle) this.apply(snapshot);
  }

  /** Accept or reject what is shown here; the server tells where somebody has decided on it since. */
  decide(verdict) {
    const { integration, revision } = this.snapshot;
    return this.act(verdict, { integration, revision, who: name() });
  }

  /** Decide many in one step, on the best candidates of each; where there is no view, the project does it. */
  decideMany(integrations, verdict) {
    if (this.id === null) return this.project.decide(integrations, verdict);
    return this.act("decide_many", { integrations, verdict, revision: this.project.info.revision, who: name() });
  }

  /** Select an integration: shown at once; of many quick selections only the last is sent, and only its answer counts. */
  async select(id) {
    this.apply({ ...this.snapshot, integration: id, candidate: 0 });
    const idle = this.#wanted === null;
    this.#wanted = id;
    while (idle && this.#wanted !== null) await this.#sendWanted();
  }

  /** A snapshot that came by itself: the scene's own panel was used. Of several, and beside an action, the newest counts. */
  hear(snapshot) {
    if (this.#heard === null) setTimeout(() => this.#settle(), SETTLE);
    if (!(snapshot.serial < this.#heard?.serial)) this.#heard = snapshot;
  }

  /** Show a snapshot, unless a newer one is shown already: they may arrive in another order than they were made in. */
  apply(snapshot) {
    if (snapshot.serial < this.snapshot.serial) return;
    this.snapshot = snapshot;
    this.dispatchEvent(new Event("changed"));
  }

  /** Open the view again where the server has dropped it. */
  async check() {
    if (this.id === null) return;
    try {
      this.hear(await get(this.#url));
    } catch (error) {
      if (error.status !== 404) throw error;
      await this.open();
    }
  }

  /** Why the candidate shown has its value and its score. */
  explanation(signal) {
    return this.id === null ? null : get(`${this.#url}/explanation`, { signal });
  }

  /** The selected integration in full, as the view has it: with parameters on trial, what those make of it. */
  detail(signal) {
    return get(`${this.#url}/detail`, { signal });
  }

  close() {
    if (this.id !== null && !this.shared) fetch(this.#url, { method: "DELETE", keepalive: true }).catch(() => {});
  }

  /** The view is closed and there is nothing left to look at. */
  forget() {
    this.id = null;
  }

  get #url() {
    return `/api/views/${encodeURIComponent(this.id)}`;
  }

  #settle() {
    const snapshot = this.#heard;
    this.#heard = null;
    if (this.#idle) this.apply(snapshot);
  }

  get #idle() {
    return this.#sending === 0 && this.#wanted === null;
  }

  async #sendWanted() {
    const sent = this.#wanted;
    const snapshot = await this.#send("select", sent).catch((error) => this.project.tell("trouble", error));
    if (this.#wanted !== sent) return;
    this.#wanted = null;
    if (snapshot && this.#idle) this.apply(snapshot);
  }

  /** Send actions one after the other. */
  #send(action, value) {
    this.#sending += 1;
    const sent = this.#queue.then(() => this.#post(action, value)).finally(() => (this.#sending -= 1));
    this.#queue = sent.catch(() => {});
    return sent;
  }

  async #post(action, value) {
    try {
      return await post(this.#url, { action, value });
    } catch (error) {
      if (error.status !== 404) throw error;
      await this.open();
      return post(this.#url, { action, value });
    }
  }
}
