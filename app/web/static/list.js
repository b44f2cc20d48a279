"use strict";
/* The list of jobs: newest first, live, narrowed by filters that stand in the address (#/?status=failed&label=x). */

const STATUSES = ["queued", "running", "cancelling", "succeeded", "failed", "cancelled", "expired"];
const FINAL = ["succeeded", "failed", "cancelled", "expired"];
const LIVE_ROWS = 3; // event streams of the list: a browser opens six connections per host at most
const LIST_POLL_MS = 3000;
const MAX_LABEL = 100; // characters, as the service has it
const TYPING_MS = 300; // after the last key before a label is searched for
const COLUMNS = [{ text: "Label or id", long: true }, "Operation", "Status", { text: "Aircraft", long: true }, { text: "Asked for", long: true }, "Progress", number("Best cost, rad²"), "Created"];

/* ---- filters ---- */

/* The filters of an address; what the service does not know is left out. */
function filtersOf(hash) {
  const given = new URLSearchParams(hash.split("?")[1] ?? "");
  return {
    status: STATUSES.filter((status) => given.getAll("status").includes(status)),
    operation: OPERATIONS.includes(given.get("operation")) ? given.get("operation") : "",
    label: (given.get("label") ?? "").replace(/[\x00-\x1f\x7f]/g, "").trim().slice(0, MAX_LABEL),
  };
}

function queryOf({ status, operation, label }) {
  const query = new URLSearchParams(status.map((name) => ["status", name]));
  if (operation) query.set("operation", operation);
  if (label) query.set("label", label);
  return query.toString();
}

function filterForm(filters, onChange) {
  const choice = (status) => element("label", { class: "choice" }, element("input", { type: "checkbox", name: "status", value: status, checked: filters.status.includes(status) }), status);
  const operations = element("select", { id: "operation" }, element("option", { value: "" }, "any"), ...OPERATIONS.map((name) => element("option", { selected: filters.operation === name }, name)));
  const label = element("input", { id: "label", type: "search", maxlength: MAX_LABEL, value: filters.label, placeholder: "exact label", spellcheck: "false", autocomplete: "off" });
  const clear = element("button", { type: "button", hidden: queryOf(filters) === "", on: { click: () => (location.hash = "#/") } }, "Clear filters");
  const form = element(
    "form",
    { class: "card filters", "aria-label": "Filters" },
    element("fieldset", {}, element("legend", {}, "Status"), ...STATUSES.map(choice)),
    element("div", { class: "field" }, element("label", { for: "operation" }, "Operation"), operations),
    element("div", { class: "field" }, element("label", { for: "label" }, "Label"), label),
    clear,
  );
  let typing;
  const apply = () => {
    const chosen = { status: [...form.querySelectorAll("[name=status]:checked")].map((box) => box.value), operation: operations.value, label: label.value.trim() };
    clear.hidden = queryOf(chosen) === "";
    onChange(chosen);
  };
  form.addEventListener("input", (event) => { clearTimeout(typing); typing = setTimeout(apply, event.target === label ? TYPING_MS : 0); });
  form.addEventListener("submit", (event) => { event.preventDefault(); clearTimeout(typing); apply(); });
  return form;
}

/* ---- rows ---- */

function jobRow(job) {
  const address = `#/jobs/${job.id}`;
  const link = element("a", { href: address, title: job.id }, job.label ?? `…${job.id.slice(-6)}`);
  const cells = [link, job.operation, pill(job.status), job.request.aircraft ?? "–", described(job), bar(job), show.cost(job.progress?.best_cost), element("span", { title: show.time(job.created_at) }, show.moment(job.created_at))];
  const go = (event) => { if (event.target.closest("a") === null) location.hash = address; };
  return tableRow(COLUMNS, cells, { class: "link", on: { click: go } });
}

function emptyList(filtered) {
  if (filtered) return element("p", { class: "empty" }, "No job matches these filters.");
  const command = `morphid identify --url ${location.origin} \\\n  --aircraft examples/aircraft.json --flight examples/flight.json \\\n  --sample examples/train_rate_0.5.csv`;
  return element("div", { class: "empty" }, element("p", {}, "No jobs yet. Start one:"), element("pre", { tabindex: 0 }, command), element("p", {}, element("a", { href: "#/help/start" }, "Other ways to start a job")));
}

/* ---- the view ---- */

async function listView() {
  const rows = new Map(); // id -> {job, row}
  const sources = new Map(); // id -> event stream
  const shown = table(COLUMNS, [], { stack: true });
  const body = shown.tBodies[0];
  const content = element("div");
  const more = element("button", { hidden: true }, "Older jobs");
  let filters = filtersOf(location.hash), cursor = null;

  function place(job) {
    const old = rows.get(job.id);
    if (old && JSON.stringify(old.job) === JSON.stringify(job)) return;
    const row = jobRow(job), focused = old?.row.contains(document.activeElement);
    old?.row.replaceWith(row);
    rows.set(job.id, { job, row });
    if (focused) row.querySelector("a").focus({ preventScroll: true });
  }

  function arrange() {
    const order = [...rows.keys()].sort().reverse().map((id) => rows.get(id).row); // ids rise with time
    const focused = body.contains(document.activeElement) ? document.activeElement : null;
    if (order.length !== body.rows.length || order.some((row, i) => row !== body.rows[i])) body.replaceChildren(...order);
    focused?.focus({ preventScroll: true });
    const filtered = queryOf(filters) !== "", state = rows.size ? "rows" : `none of ${filtered}`;
    if (content.dataset.state !== state) content.replaceChildren(element("section", { class: "card" }, rows.size ? shown : emptyList(filtered)));
    content.dataset.state = state;
    more.hidden = cursor === null;
  }

  function followRunning() {
    const running = [...rows.values()].map(({ job }) => job).filter((job) => job.status === "running" || job.status === "cancelling").slice(0, LIVE_ROWS);
    for (const [id, source] of sources) {
      if (!running.some((job) => job.id === id)) { source.close(); sources.delete(id); }
    }
    const onEvent = (id, name, data) => {
      if (!rows.has(id)) return;
      const { job } = rows.get(id);
      place({ ...job, status: data.status, progress: name === "progress" ? data : job.progress });
    };
    for (const job of running) {
      if (!sources.has(job.id)) sources.set(job.id, follow(job.id, (name, data) => onEvent(job.id, name, data), job.last_event));
    }
  }

  async function refresh() {
    const used = filters;
    const page = await call(`/jobs?limit=25&${queryOf(filters)}`);
    if (used !== filters) return; // the filters were changed meanwhile, or the list was left
    const listed = new Set(page.jobs.map((job) => job.id)), oldest = page.jobs.at(-1)?.id;
    for (const id of rows.keys()) {
      if (!listed.has(id) && (page.next_cursor === null || id >= oldest)) rows.delete(id); // deleted, or of another status by now
    }
    if (rows.size <= listed.size) cursor = page.next_cursor;
    page.jobs.forEach(place);
    arrange();
    followRunning();
  }

  function change(chosen) {
    filters = chosen;
    rows.clear();
    const query = queryOf(chosen);
    history.replaceState(null, "", query ? `#/?${query}` : "#/"); // a reload and a copied address keep the filters
    refresh().catch((error) => { content.replaceChildren(problemCard(error)); content.dataset.state = "problem"; });
  }

  async function older() {
    const used = filters;
    const page = await call(`/jobs?limit=25&cursor=${encodeURIComponent(cursor)}&${queryOf(filters)}`);
    if (used !== filters) return;
    page.jobs.forEach(place);
    cursor = page.next_cursor;
    arrange();
  }

  more.addEventListener("click", () => older().catch((error) => view.prepend(problemCard(error))));
  view.replaceChildren(element("h1", {}, "Jobs"), filterForm(filters, change), content, more);
  const timer = setInterval(() => refresh().catch(() => {}), LIST_POLL_MS);
  leave = () => { filters = null; clearInterval(timer); sources.forEach((source) => source.close()); };
  await refresh();
}
