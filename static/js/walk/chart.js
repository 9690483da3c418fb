// Small charts beside the picture: bars, a line with the point of the step, dots, and a tree of integrations.

import { element } from "./figure.js";

const WIDTH = 340;
const HEIGHT = 190;
const EDGE = { left: 44, right: 10, top: 24, bottom: 34 };

/** Draw a chart; `at` is the point of the step on it, `enter(node)` is called for a node of a tree. */
export function chart(told, at, enter) {
  const drawn = { bars, series, dots, tree }[told.kind](told, at, enter);
  const height = told.kind === "tree" ? drawn.height : HEIGHT;
  const title = element("title");
  title.textContent = told.title;
  const words = [title, said(told.title, WIDTH / 2, 14, "chart-title"), ...drawn.parts];
  return element("svg", { class: "chart", role: "img", viewBox: `0 0 ${WIDTH} ${height}` }, ...words);
}

function bars({ values, marked, x, y, names, legend = [] }) {
  const scale = axes(x, y, [0, values.length], [0, Math.max(...values, 1e-9)]);
  if (names) scale.parts = scale.parts.filter((part) => !part.matches(".across"));
  const below = (name, place) => said(name, scale.place(place + 0.5, 0)[0], HEIGHT - EDGE.bottom + 14, "tick middle");
  const parts = values.map((value, number) => {
    const [left, top] = scale.place(number, value);
    const [right, bottom] = scale.place(number + 1, 0);
    const size = { x: left + 0.5, y: top, width: Math.max(1, right - left - 1), height: bottom - top };
    return element("rect", { ...size, class: `bar role-${marked[number] ?? "first"}` });
  });
  const notes = legend.map(([role, words], number) => said(words, WIDTH - 14, 34 + 14 * number, `legend role-${role}`));
  return { parts: [...scale.parts, ...parts, ...notes, ...(names ?? []).map(below)] };
}

function series({ values, x, y }, at) {
  const xs = values.map(([place]) => place);
  const ys = values.map(([, value]) => value);
  const scale = axes(x, y, [Math.min(...xs), Math.max(...xs)], [0, Math.max(...ys, at?.[1] ?? 0, 1e-9)]);
  const d = values.map((point, number) => `${number ? "L" : "M"}${scale.place(...point).join(" ")}`).join("");
  const parts = [...scale.parts, element("path", { d, class: "curve role-first" })];
  return { parts: at ? [...parts, dot(scale.place(...at), "accent", 5)] : parts };
}

function dots({ points, x, y, logarithmic }) {
  const along = points.map((point) => (logarithmic ? Math.log10(Math.max(1e-9, point.x)) : point.x));
  const scale = axes(x, y, spread(along), [0, 1.1 * Math.max(...points.map((point) => point.y), 1e-9)], logarithmic);
  const taken = [];
  const parts = points.flatMap((point, number) => {
    const place = scale.place(along[number], point.y);
    const made = dot(place, point.role, 4);
    return point.label ? [made, beside(point.label, place, taken)] : [made];
  });
  return { parts: [...scale.parts, ...parts] };
}

/** A word at the right or the left of a dot, lower where another one stands already. */
function beside(words, [x, y], taken) {
  const width = 6 * words.length;
  const left = x + 8 + width > WIDTH ? x - 8 - width : x + 8;
  let line = y + 4;
  const meets = (other) => Math.abs(other.line - line) < 11 && left < other.left + other.width && other.left < left + width;
  while (taken.some(meets)) line += 11;
  taken.push({ left, line, width });
  return said(words, left, line, "tick");
}

function tree({ nodes, edges }, at, enter) {
  const [columns, rows] = [Math.max(...nodes.map((node) => node.x)), Math.max(...nodes.map((node) => node.y))];
  const height = Math.min(520, 60 + 34 * (rows + 1));
  const place = ({ x, y }) => [20 + (x / Math.max(1, columns)) * (WIDTH - 40), 40 + (y / Math.max(1, rows)) * (height - 70)];
  const parts = edges.map(([from, to]) => {
    const [[x1, y1], [x2, y2]] = [place(nodes[from]), place(nodes[to])];
    return element("path", { d: `M${x1} ${y1}L${x2} ${y2}`, class: "branch" });
  });
  nodes.forEach((node, number) => parts.push(knot(node, place(node), number === at?.[0], enter)));
  return { parts, height };
}

function knot(node, place, current, enter) {
  const made = dot(place, current ? "accent" : node.role, current ? 7 : 5);
  const title = element("title");
  title.textContent = node.label;
  made.append(title);
  if (node.enter === undefined || !enter) return made;
  const button = { class: "knot", role: "button", tabindex: 0, "aria-label": `Step of ${node.label}` };
  const group = element("g", button, made);
  group.addEventListener("click", () => enter(node.enter));
  group.addEventListener("keydown", (event) => event.key === "Enter" && enter(node.enter));
  return group;
}

function axes(x, y, [x1, x2], [y1, y2], logarithmic = false) {
  const [w, h] = [WIDTH - EDGE.left - EDGE.right, HEIGHT - EDGE.top - EDGE.bottom];
  const place = (px, py) => [
    EDGE.left + ((px - x1) / (x2 - x1 || 1)) * w,
    EDGE.top + h - ((py - y1) / (y2 - y1 || 1)) * h,
  ];
  const [left, bottom] = place(x1, y1);
  const real = (value) => (logarithmic ? 10 ** value : value);
  const frame = element("path", { d: `M${left} ${EDGE.top}V${bottom}H${left + w}`, class: "axis" });
  const parts = [
    frame,
    said(number(y2), left - 5, EDGE.top + 9, "tick end"),
    said(number(y1), left - 5, bottom, "tick end"),
    said(y, left - 5, EDGE.top + h / 2, "tick end"),
    said(number(real(x1)), left, bottom + 13, "tick across"),
    said(number(real(x2)), left + w, bottom + 13, "tick end across"),
    said(x, left + w / 2, bottom + 27, "tick middle"),
  ];
  return { place, parts };
}

function spread(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.08 * (high - low) || 0.5;
  return [low - margin, high + margin];
}

const number = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(3))));

function dot([cx, cy], role, r) {
  return element("circle", { cx, cy, r, class: `dot role-${role}` });
}

function said(words, x, y, kind) {
  const made = element("text", { x, y, class: kind });
  made.textContent = words;
  return made;
}
