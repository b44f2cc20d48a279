"use strict";
/* Building blocks of the page: elements from data (never from HTML text), numbers and times for people. */

function element(name, options = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(options)) {
    if (key === "on") for (const [event, handler] of Object.entries(value)) node.addEventListener(event, handler);
    else if (key === "class") node.className = value ?? "";
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

function svg(name, attributes = {}, text = "") {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.textContent = text;
  return node;
}

const show = {
  number: (value, digits = 3) => {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(digits - 1);
    return value.toLocaleString("en", { maximumSignificantDigits: digits + 1 });
  },
  milliradians: (value) => (value === null || value === undefined ? "–" : (value * 1000).toPrecision(3)),
  milliseconds: (seconds) => (seconds === null || seconds === undefined ? "–" : (seconds * 1000).toPrecision(3)),
  duration: (seconds) => {
    if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
    if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
    const minutes = Math.floor(seconds / 60);
    return minutes < 60 ? `${minutes} min ${Math.round(seconds % 60)} s` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
  },
  time: (text) => (text ? new Date(text).toLocaleString() : "–"),
  bytes: (size) => (size < 1024 ? `${size} B` : `${(size / 1024).toFixed(0)} kB`),
};

function pill(status) {
  return element("span", { class: `pill ${status}` }, status);
}

function bar(job) {
  const fraction = job.status === "succeeded" ? 1 : job.progress?.fraction ?? 0;
  const fill = element("div");
  fill.style.width = `${Math.round(100 * fraction)}%`;
  return element(
    "div",
    { class: `bar ${job.status === "succeeded" ? "done" : ""}`, role: "progressbar", "aria-valuenow": Math.round(100 * fraction), "aria-valuemin": 0, "aria-valuemax": 100 },
    fill,
  );
}

/* A table; the row of the number `marked` stands out. */
function table(titles, rows, marked = -1) {
  const heads = titles.map((title) => element("th", { class: title.number ? "number" : "" }, title.text ?? title));
  const body = rows.map((cells, row) =>
    element("tr", { class: row === marked ? "marked" : null }, ...cells.map((cell, i) => element("td", { class: titles[i].number ? "number" : "" }, cell))),
  );
  return element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...body));
}

/* Best cost over generations, logarithmic: [[generation, cost], ...] */
function convergence(points) {
  const usable = points.filter(([, cost]) => cost > 0);
  const plot = svg("svg", { class: "live", viewBox: "0 0 600 200", role: "img", "aria-label": "best cost over generations" });
  if (usable.length < 2) return plot;
  const logs = usable.map(([, cost]) => Math.log10(cost));
  const low = Math.floor(Math.min(...logs)), high = Math.max(Math.ceil(Math.max(...logs)), low + 1);
  const first = usable[0][0], span = Math.max(usable.at(-1)[0] - first, 1);
  const x = (generation) => 44 + (546 * (generation - first)) / span;
  const y = (log) => 10 + (170 * (high - log)) / (high - low);
  for (let decade = low; decade <= high; decade += Math.ceil((high - low) / 6)) {
    plot.append(svg("line", { class: "grid", x1: 44, x2: 590, y1: y(decade), y2: y(decade) }));
    plot.append(svg("text", { x: 4, y: y(decade) + 4 }, `1e${decade}`));
  }
  plot.append(svg("text", { x: 44, y: 197 }, `generation ${first}`), svg("text", { x: 590, y: 197, "text-anchor": "end" }, `${first + span}`));
  plot.append(svg("polyline", { class: "curve", points: usable.map(([g], i) => `${x(g).toFixed(1)},${y(logs[i]).toFixed(1)}`).join(" ") }));
  return plot;
}
