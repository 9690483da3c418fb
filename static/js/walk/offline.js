// A walkthrough in a file of its own: all its steps are in the page, nothing is fetched.

import { byId, fill, h } from "../dom.js";
import { Player } from "./player.js";

const held = JSON.parse(byId("walk").textContent);
const place = new URLSearchParams(location.hash.slice(1));
const player = new Player(byId("player"), held.walk, { load: async (stage, step) => held.steps[stage.id][step] });

player.addEventListener("step", ({ detail }) => history.replaceState(null, "", `#${new URLSearchParams(detail)}`));
player.go(place.get("stage") || held.walk.stages[0].id, place.get("step") ?? 0);
fill(byId("about"), h("span.muted", {}, held.about));
