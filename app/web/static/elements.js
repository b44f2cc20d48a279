"use strict";
/* Building blocks of the page: elements from data, never from HTML text. */

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

/* Replace what a container shows; the keyboard's focus stays on the control of the same place. */
function refill(container, ...children) {
  const controls = () => [...container.querySelectorAll("a, button, summary")];
  const focused = controls().indexOf(document.activeElement);
  container.replaceChildren(...children);
  if (focused >= 0) controls()[focused]?.focus({ preventScroll: true });
}

function pill(status) {
  return element("span", { class: `pill ${status}` }, status);
}

function bar(job) {
  const percent = Math.round(100 * (job.status === "succeeded" ? 1 : job.progress?.fraction ?? 0));
  const fill = element("div");
  fill.style.width = `${percent}%`;
  const options = { role: "progressbar", "aria-label": "progress", "aria-valuenow": percent, "aria-valuemin": 0, "aria-valuemax": 100 };
  return element("div", { class: `bar ${job.status === "succeeded" ? "done" : ""}`, ...options }, fill);
}

/* A table of `titles` ("text", or {text, number: true}). On a narrow screen one with `stack` shows each row as a
   list of "title value" lines; roles are spelled out because such a layout would take them away.

   options: marked: the number of the row that stands out; stack; wide: false keeps it as narrow as its content */
function table(titles, rows, { marked = -1, stack = false, wide = true } = {}) {
  const kind = (title) => (title.number ? "number" : null);
  const heads = titles.map((title) => element("th", { class: kind(title), role: "columnheader", scope: "col" }, title.text ?? title));
  const body = element("tbody", { role: "rowgroup" }, ...rows.map((cells, row) => tableRow(titles, cells, row === marked ? { class: "marked" } : {})));
  const head = element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...heads));
  return element("table", { class: [stack && "stack", !wide && "narrow"].filter(Boolean).join(" "), role: "table" }, head, body);
}

function tableRow(titles, cells, options = {}) {
  const cell = (content, i) => element("td", { class: titles[i].number ? "number" : titles[i].long ? "long" : null, role: "cell", "data-title": titles[i].text ?? titles[i] }, content);
  return element("tr", { role: "row", ...options }, ...cells.map(cell));
}

function facts(entries) {
  return element("dl", { class: "facts" }, ...entries.map(([title, value]) => element("div", {}, element("dt", {}, title), element("dd", {}, value))));
}

/* A part of the page with a heading, and a link to what its numbers mean where there is such a place in the help. */
function card(title, { help = null, kind = "" }, ...content) {
  const link = help && element("a", { class: "help", href: `#/help/${help}`, "aria-label": `Help: ${title}` }, "What is this?");
  return element("section", { class: `card ${kind}` }, element("div", { class: "row" }, element("h2", {}, title), link), ...content);
}

/* What went wrong, where, and what to do: of a refused call (a problem document) or of a failed job. */
function problemCard(error) {
  const problem = error.problem ?? { detail: error.message };
  return card(
    problem.title ?? "Something went wrong",
    { kind: "problem" },
    element("p", {}, problem.detail ?? ""),
    problem.hint ? element("p", {}, element("b", {}, "What to do: "), problem.hint) : null,
    problem.pointer ? pointerLine(problem.pointer) : null,
  );
}

/* Where in the request something stands: a JSON pointer. */
function pointerLine(pointer) {
  return element("p", { class: "soft" }, "In the request: ", element("code", {}, pointer));
}
