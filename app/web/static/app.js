"use strict";
/* Three views: the list of jobs (#/), one job (#/jobs/ID), and a field for the API key when one is wanted. */

const view = document.getElementById("view");
const FINAL = ["succeeded", "failed", "cancelled", "expired"];
const LIVE_ROWS = 3; // event streams of the list: a browser opens six connections per host at most
const LIST_POLL_MS = 3000;
let leave = () => {};

function problemCard(error) {
  const told = error.problem ?? { detail: error.message };
  return element("section", { class: "card problem" }, element("h2", {}, told.title ?? "Something went wrong"), element("p", {}, told.detail ?? ""), element("p", { class: "soft" }, told.hint ?? ""));
}

/* ---- list ---- */

async function listView() {
  const rows = new Map();
  const sources = new Map();
  const body = element("tbody");
  const heads = ["Status", "Operation", "Aircraft", "What", "Progress", "Best cost", "Created"].map((text) => element("th", {}, text));
  const more = element("button", {}, "Older jobs");
  const older = element("tbody");
  let cursor = null;
  view.replaceChildren(
    element("h1", {}, "Jobs"),
    element("section", { class: "card" }, element("table", {}, element("thead", {}, element("tr", {}, ...heads)), body, older)),
    more,
  );

  function rowOf(job) {
    const go = () => (location.hash = `#/jobs/${job.id}`);
    return element(
      "tr",
      { class: "link", tabindex: 0, on: { click: go, keydown: (event) => event.key === "Enter" && go() } },
      element("td", {}, pill(job.status)),
      element("td", {}, job.operation),
      element("td", { class: "long" }, job.request.aircraft ?? "–"),
      element("td", { class: "long" }, described(job)),
      element("td", {}, bar(job)),
      element("td", {}, show.number(job.progress?.best_cost)),
      element("td", { class: "soft" }, show.time(job.created_at)),
    );
  }

  function place(job) {
    const row = rowOf(job);
    rows.get(job.id)?.row.replaceWith(row);
    rows.set(job.id, { job, row });
    return row;
  }

  function onEvent(id, name, data) {
    const { job } = rows.get(id);
    place({ ...job, status: data.status, progress: name === "progress" ? data : job.progress });
  }

  async function refresh() {
    const page = await call("/jobs?limit=25");
    body.replaceChildren(...page.jobs.map(place));
    if (cursor === null) cursor = page.next_cursor;
    more.hidden = cursor === null;
    if (page.jobs.length === 0) body.replaceChildren(element("tr", {}, element("td", { colspan: 7, class: "empty" }, "No jobs yet. Start one: ", element("pre", {}, "morphid identify --url " + location.origin + " \\\n  --aircraft examples/aircraft.json --flight examples/flight.json \\\n  --sample examples/train_rate_0.5.csv"))));
    const running = page.jobs.filter((job) => job.status === "running" || job.status === "cancelling").slice(0, LIVE_ROWS);
    for (const [id, source] of sources) {
      if (!running.some((job) => job.id === id)) { source.close(); sources.delete(id); }
    }
    for (const job of running) {
      if (!sources.has(job.id)) sources.set(job.id, follow(job.id, (name, data) => onEvent(job.id, name, data), job.last_event));
    }
  }

  more.addEventListener("click", async () => {
    const page = await call(`/jobs?limit=25&cursor=${cursor}`);
    older.append(...page.jobs.map(place));
    cursor = page.next_cursor;
    more.hidden = cursor === null;
  });
  const timer = setInterval(() => refresh().catch(() => {}), LIST_POLL_MS);
  leave = () => { clearInterval(timer); sources.forEach((source) => source.close()); };
  await refresh();
}

/* ---- one job ---- */

function searchFacts(progress) {
  if (progress.flights === null || progress.flights === undefined) return [];
  return [
    ["Generation", String(progress.generation ?? "–")],
    ["Best cost, rad²", show.number(progress.best_cost)],
    ["Flights", show.number(progress.flights, 8)],
    ["Flights per second", show.number(progress.flights_per_s)],
  ];
}

function headCard(job) {
  const act = async (path, method) => {
    try { await call(path, { method }); method === "DELETE" ? (location.hash = "#/") : route(); } catch (error) { view.prepend(problemCard(error)); }
  };
  const button = FINAL.includes(job.status)
    ? element("button", { class: "bad push", on: { click: () => confirm("Delete this job with its files?") && act(`/jobs/${job.id}`, "DELETE") } }, "Delete")
    : element("button", { class: "bad push", disabled: job.status === "cancelling", on: { click: () => act(job.links.cancel, "POST") } }, "Cancel");
  const progress = job.progress ?? {};
  const from = job.started_at ? new Date(job.started_at) : null;
  const elapsed = from ? ((job.finished_at ? new Date(job.finished_at) : new Date()) - from) / 1000 : null;
  return element(
    "section",
    { class: "card" },
    element("div", { class: "row" }, element("h1", {}, `${job.operation}: ${job.request.aircraft ?? "aircraft"}`), pill(job.status), job.partial ? element("span", { class: "soft" }, "best so far") : null, button),
    element("div", { class: "soft mono" }, job.id),
    element("p", {}, bar(job)),
    element("div", { class: "soft" }, progress.message ?? ""),
    facts([
      ["Asked for", described(job)],
      ["Phase", progress.phase ?? "–"],
      ...searchFacts(progress),
      ["Running for", show.duration(elapsed)],
      ["Remaining", FINAL.includes(job.status) ? "–" : show.duration(progress.eta_s)],
      ["Attempt", `${job.attempt} of ${job.max_attempts}`],
      ...(job.model_id ? [["Kept as", fileLink(`/models/${job.model_id}`, `${job.model_id}.json`, {}, "identified model")]] : []),
    ]),
  );
}

async function jobView(id) {
  const points = [];
  const log = [];
  let job = await call(`/jobs/${id}`);
  const head = element("div"), live = element("div"), results = element("div"), events = element("details", { class: "card" });
  view.replaceChildren(head, results, live, events);

  function draw() {
    head.replaceChildren(headCard(job));
    live.replaceChildren(points.length > 1 ? element("section", { class: "card" }, element("h2", {}, "Convergence"), convergence(points)) : "");
    const rows = log.slice(-200).reverse().map(([name, data]) => [String(data.seq), name, show.time(data.at), data.message ?? data.reason ?? data.worker ?? ""]);
    events.replaceChildren(element("summary", {}, `History (${log.length} events)`), table(["#", "Event", "Time", ""], rows));
  }

  async function finish() {
    job = await call(`/jobs/${id}`);
    draw();
    const parts = [];
    if (job.error) parts.push(problemCard({ problem: { title: `Failed: ${job.error.code}`, detail: job.error.detail, hint: job.error.hint } }));
    try {
      parts.push(...resultCards(job.operation, await call(job.links.result)));
    } catch (error) {
      if (!error.problem) throw error; // no result is told by the status and the error card
    }
    parts.push(...filesCards((await call(job.links.artifacts)).artifacts));
    results.replaceChildren(...parts);
  }

  let pending = false;
  const redraw = () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  };
  draw();
  const source = follow(id, (name, data) => {
    log.push([name, data]);
    if (name === "progress") {
      job.progress = data;
      if (data.best_cost != null) points.push([data.generation ?? points.length, data.best_cost]);
    }
    job.status = data.status;
    job.attempt = data.attempt;
    if (name === "started" && !job.started_at) job.started_at = data.at;
    if (FINAL.includes(name)) finish().catch((error) => results.replaceChildren(problemCard(error)));
    redraw();
  });
  const timer = setInterval(() => { if (!FINAL.includes(job.status)) redraw(); }, 1000);
  leave = () => { source.close(); clearInterval(timer); };
}

/* ---- key ---- */

function keyView() {
  leave();
  leave = () => {};
  const refused = session.key !== "";
  session.key = "";
  document.getElementById("who").replaceChildren();
  const field = element("input", { type: "password", id: "key", autocomplete: "off", spellcheck: "false", placeholder: "mid_…" });
  const form = element(
    "form",
    { class: "row", on: { submit: (event) => { event.preventDefault(); session.key = field.value.trim(); if (session.key) start(); } } },
    element("label", { for: "key" }, "API key"), field, element("button", { type: "submit" }, "Use this key"),
  );
  view.replaceChildren(element(
    "section",
    { class: "card" },
    element("h1", {}, refused ? "This key is not valid" : "This service needs an API key"),
    refused ? element("p", { class: "soft" }, "It is unknown, was revoked or has expired.") : null,
    form,
    element("p", { class: "soft" }, "It stays in this tab and is forgotten with it. The operator makes keys with "), element("pre", { class: "mono" }, "morphid keys create --owner NAME --name PURPOSE"),
  ));
  field.focus();
}

async function who() {
  const sign = document.getElementById("who");
  if (!session.key) return sign.replaceChildren();
  const me = await call("/me").catch(() => null);
  if (me === null) return sign.replaceChildren();
  const forget = element("button", { on: { click: () => { session.key = ""; start(); } } }, "Forget the key");
  sign.replaceChildren(element("span", { class: "soft", title: me.scopes.join(", ") }, me.owner), forget);
}

/* ---- frame ---- */

async function start() {
  const held = session.key !== "";
  await who(); // one call tells whether the key is good
  if (!held || session.key) route();
}

async function route() {
  leave();
  leave = () => {};
  const match = /^#\/jobs\/([A-Za-z0-9_]+)$/.exec(location.hash);
  try {
    await (match ? jobView(match[1]) : listView());
  } catch (error) {
    if (error.status !== 401) view.replaceChildren(problemCard(error));
  }
}

/* What is wrong with the service, the worst first. */
function complaint(state) {
  if (state.database !== "ok") return ["bad", `database ${state.database}`];
  if (state.broker !== "ok") return ["warn", `broker ${state.broker}`];
  if (state.status !== "ready") return ["warn", `workers: ${state.workers?.status ?? "unknown"}`];
  return ["good", "ready"];
}

async function health() {
  const sign = document.getElementById("health");
  let told = ["bad", "service unreachable"];
  try {
    told = complaint(await (await fetch("/readyz")).json());
  } catch { /* it is what it says */ }
  sign.className = `health ${told[0]}`;
  sign.textContent = told[1];
}

addEventListener("hashchange", route);
setInterval(health, 10000);
session.onRefused = keyView;
health();
start();
