// The picture of a step: lines and points in metres, drawn as SVG. Drag to move it, turn the wheel to come closer.

const NAMESPACE = "http://www.w3.org/2000/svg";
const ZOOM = 1.0015;

export class Figure {
  #svg = element("svg", { class: "figure", role: "img" });
  #picture = { shapes: [], box: [-1, -1, 1, 1] };
  #base = {};
  #window = null;

  constructor(label) {
    this.#svg.setAttribute("aria-label", label);
    this.#svg.addEventListener("wheel", (event) => this.#zoom(event), { passive: false });
    this.#svg.addEventListener("pointerdown", (event) => this.#drag(event));
    this.#svg.addEventListener("dblclick", () => ((this.#window = null), this.#draw()));
    new ResizeObserver(() => this.#draw()).observe(this.#svg);
  }

  get element() {
    return this.#svg;
  }

  /** Draw shapes; `base` holds what many pictures share, `box` is what must be seen of it. */
  show(shapes, base, box) {
    if (String(box) !== String(this.#picture.box)) this.#window = null;
    this.#picture = { shapes, box };
    this.#base = base;
    this.#draw();
  }

  #draw() {
    const { clientWidth: width, clientHeight: height } = this.#svg;
    if (!width || !height) return;
    const [x1, y1, x2, y2] = this.#window ?? fitted(this.#picture.box, width, height);
    const scale = width / (x2 - x1);
    const place = ([x, y]) => [(x - x1) * scale, (y2 - y) * scale];
    const drawn = this.#picture.shapes.map((shape) => drawing(shape, this.#base, place));
    this.#svg.replaceChildren(...drawn, ruler(scale, height));
    this.#svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  }

  #shown() {
    return this.#window ?? fitted(this.#picture.box, this.#svg.clientWidth, this.#svg.clientHeight);
  }

  #zoom(event) {
    event.preventDefault();
    const [x1, y1, x2, y2] = this.#shown();
    const factor = ZOOM ** event.deltaY;
    const x = x1 + (event.offsetX / this.#svg.clientWidth) * (x2 - x1);
    const y = y2 - (event.offsetY / this.#svg.clientHeight) * (y2 - y1);
    this.#window = [x + (x1 - x) * factor, y + (y1 - y) * factor, x + (x2 - x) * factor, y + (y2 - y) * factor];
    this.#draw();
  }

  #drag(event) {
    const begun = this.#shown();
    const metre = (begun[2] - begun[0]) / this.#svg.clientWidth;
    this.#svg.setPointerCapture(event.pointerId);
    const move = ({ clientX, clientY }) => {
      const [dx, dy] = [(event.clientX - clientX) * metre, (clientY - event.clientY) * metre];
      this.#window = [begun[0] + dx, begun[1] + dy, begun[2] + dx, begun[3] + dy];
      this.#draw();
    };
    this.#svg.addEventListener("pointermove", move);
    this.#svg.addEventListener("pointerup", () => this.#svg.removeEventListener("pointermove", move), { once: true });
  }
}

/** An SVG element. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** A box widened to the shape of the window. */
function fitted([x1, y1, x2, y2], width, height) {
  const [w, h] = [Math.max(x2 - x1, 1e-6), Math.max(y2 - y1, 1e-6)];
  const scale = Math.min(width / w, height / h);
  const [dx, dy] = [(width / scale - w) / 2, (height / scale - h) / 2];
  return [x1 - dx, y1 - dy, x2 + dx, y2 + dy];
}

function drawing(shape, base, place) {
  const rows = coordinates(shape, base);
  const attributes = { class: `shape ${shape.kind} role-${shape.role}` };
  if (shape.kind === "text") return label(shape, place(rows), attributes);
  if (shape.faded) attributes["stroke-opacity"] = 0.35;
  if (shape.dash) attributes["stroke-dasharray"] = "6 4";
  if (shape.mark === "cross") return crosses(rows.map(place), shape.size ?? 8, attributes);
  attributes["stroke-width"] = shape.kind === "points" ? shape.size ?? 5 : shape.width ?? 2;
  return element("path", { ...attributes, d: outline(shape.kind, rows, place) });
}

/** What a shape is made of, moved to where it is. */
function coordinates(shape, base) {
  const all = shape.of ? base[shape.of] ?? [] : shape.at;
  const rows = shape.rows ? shape.rows.map((row) => all[row]) : all;
  if (!shape.pose) return rows;
  const [x, y, theta] = shape.pose;
  const [cosine, sine] = [Math.cos(theta), Math.sin(theta)];
  const moved = (px, py) => [cosine * px - sine * py + x, sine * px + cosine * py + y];
  return rows.map((row) => (row.length === 4 ? [...moved(row[0], row[1]), ...moved(row[2], row[3])] : moved(...row)));
}

function outline(kind, rows, place) {
  const at = (x, y) => place([x, y]).map((pixel) => pixel.toFixed(2)).join(" ");
  if (kind === "lines") return rows.map(([x1, y1, x2, y2]) => `M${at(x1, y1)}L${at(x2, y2)}`).join("");
  if (kind === "path") return rows.map(([x, y], number) => `${number ? "L" : "M"}${at(x, y)}`).join("");
  return rows.map(([x, y]) => `M${at(x, y)}h0`).join("");
}

function crosses(places, size, attributes) {
  const half = size / 2;
  const d = places.map(([x, y]) => `M${x - half} ${y - half}l${size} ${size}m0 ${-size}l${-size} ${size}`).join("");
  return element("path", { ...attributes, class: `${attributes.class} cross`, "stroke-width": 2.5, d });
}

function label(shape, [x, y], attributes) {
  const made = element("text", { ...attributes, x: x + 5, y: y - 5 });
  made.textContent = shape.text;
  return made;
}

/** A bar of a round length, so that the picture has a scale. */
function ruler(scale, height) {
  const raw = 110 / scale;
  const power = 10 ** Math.floor(Math.log10(raw));
  const length = [5, 2, 1].map((step) => step * power).find((one) => one <= raw) ?? power;
  const words = element("text", { x: 16, y: height - 22 });
  words.textContent = length >= 1 ? `${length} m` : `${Math.round(length * 100)} cm`;
  const bar = element("path", { d: `M12 ${height - 18}v6h${(length * scale).toFixed(1)}v-6`, "stroke-width": 1.5 });
  return element("g", { class: "ruler" }, bar, words);
}
