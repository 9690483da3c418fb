// The drop zone: logs by drag and drop or from a file dialogue, several at once into one project.

import { ApiError, described } from "./api.js";
import { fill, h, icon } from "./dom.js";
import { count } from "./format.js";
import { sentence } from "./problems.js";

const KINDS = "CARMEN and DP-SLAM logs, ROS bags (.bag, .db3, .mcap), CSV or JSON of ranges; or a .segmap project. Several files become one project.";
const MEBIBYTES = 256; // the server takes no more at once
const TOO_LARGE = `These files have more than ${MEBIBYTES} MiB. Open them on the command line, where any size is read: segmap serve FILES`;

/** Make `zone` accept logs; `open(project)` is called with the project made of them. */
export function dropZone(zone, open) {
  const input = h("input", { type: "file", multiple: true, hidden: true, id: "files", "aria-label": "Logs to open" });
  const take = (files) => upload(zone, input, [...files], open);
  input.addEventListener("change", () => take(input.files));
  listen(zone, take);
  idle(zone, input);
}

function listen(zone, take) {
  const over = (event) => {
    event.preventDefault();
    zone.classList.add("over");
  };
  for (const kind of ["dragenter", "dragover"]) document.addEventListener(kind, over);
  document.addEventListener("dragleave", (event) => event.relatedTarget ?? zone.classList.remove("over"));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    if (event.dataTransfer.files.length && !zone.ariaBusy) take(event.dataTransfer.files);
  });
}

function idle(zone, input, message = null) {
  input.value = "";
  zone.ariaBusy = null;
  const choose = h("button.primary", { type: "button", onclick: () => input.click() }, "Choose files…");
  fill(zone, icon("upload"), h("h2", {}, "Drop laser logs here"), choose, input, h("p.kinds", {}, KINDS), message);
}

async function upload(zone, input, files, open) {
  if (!files.length) return;
  if (files.reduce((sum, file) => sum + file.size, 0) > MEBIBYTES << 20) return refuse(zone, input, TOO_LARGE);
  const meter = loading(zone, files);
  try {
    const project = await send(files, meter);
    if (project.problems?.length) idle(zone, input, readWithProblems(project, open));
    else open(project);
  } catch (error) {
    refuse(zone, input, error.message);
  }
}

function refuse(zone, input, message) {
  idle(zone, input, h("div.message.error", { role: "alert" }, h("p", {}, message)));
}

/** Show the progress of an upload; returns the function that moves it (share 0..1). */
function loading(zone, files) {
  zone.ariaBusy = "true";
  const bar = h("progress", { max: 1, value: 0, "aria-label": "Upload" });
  const what = h("p", { role: "status" }, `Loading ${files.length === 1 ? files[0].name : count(files.length, "file")}…`);
  fill(zone, icon("upload"), h("div.loading", {}, what, bar));
  return (share) => {
    bar.value = share;
    if (share >= 1) fill(what, "Reading the scans…"), bar.removeAttribute("value");
  };
}

/** Post the files; fetch cannot tell how much of a body has been sent, so this is an XMLHttpRequest. */
function send(files, meter) {
  const body = new FormData();
  for (const file of files) body.append("files", file);
  const request = new XMLHttpRequest();
  request.responseType = "json";
  request.upload.addEventListener("progress", (event) => event.lengthComputable && meter(event.loaded / event.total));
  return new Promise((resolve, reject) => {
    request.addEventListener("load", () => answer(request, resolve, reject));
    request.addEventListener("error", () => reject(new ApiError("The files could not be sent: the server does not answer.")));
    request.open("POST", "/api/projects");
    request.send(body);
  });
}

function answer(request, resolve, reject) {
  if (request.status < 300) resolve(request.response);
  else reject(described(request.status, request.response));
}

/** A log that was read, though some of its lines were left out. */
function readWithProblems(project, open) {
  const problems = project.problems;
  const lines = problems.slice(0, 8).map((problem) => h("li", {}, sentence(problem)));
  if (problems.length > 8) lines.push(h("li", {}, `and ${problems.length - 8} more, listed in the project under Logs`));
  const go = h("button.primary", { type: "button", onclick: () => open(project) }, "Open the project");
  const title = h("p", {}, `${project.name} was read, but ${count(problems.length, "line")} had to be left out:`);
  return h("div.message", { role: "status" }, title, h("ul", {}, lines), h("div.row", {}, go));
}
