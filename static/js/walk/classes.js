// A class that follows a walkthrough: the teacher's page says where it is, the others ask.

import { get, post } from "../api.js";
import { h } from "../dom.js";
import { failed, notice } from "../notices.js";

const EVERY = 700;
const HELD = "segmap.class";
const WORDS = { "aria-label": "Share with a class", title: "A link through which others see what you see" };

/** A button that gives a link to share; from then on every step of this page is told. */
export function teaching(place) {
  let led = JSON.parse(sessionStorage.getItem(HELD) ?? "null");
  const tell = () => led && post(`/api/classes/${led.id}`, { key: led.key, place: place() }).catch((error) => over(error));
  const over = (error) => (sessionStorage.removeItem(HELD), (led = null), failed(error));
  const open = async () => {
    led ??= await post("/api/classes", { place: place() });
    sessionStorage.setItem(HELD, JSON.stringify(led));
    const link = `${location.origin}/follow/walk/${led.id}`;
    await navigator.clipboard?.writeText(link).catch(() => {});
    notice(`Whoever opens ${link} sees what you see, and can change nothing.`, { kind: "link" });
  };
  const button = h("button", { type: "button", id: "share", ...WORDS, onclick: () => open().catch(failed) }, "Share");
  return { button, tell };
}

/** Follow a class: `moved(place)` is called with its address now and whenever it changes. */
export async function follow(id, moved) {
  let serial = 0;
  const look = async () => {
    const now = await get(`/follow/walk/${encodeURIComponent(id)}/place`);
    if (now.serial === serial) return;
    serial = now.serial;
    await moved(new URLSearchParams(now.place));
  };
  await look();
  const again = () => look().then(next, (error) => (error.status === 404 ? failed(error) : next()));
  const next = () => setTimeout(again, EVERY);
  next();
}
