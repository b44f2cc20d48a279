"use strict";
/* One job: its state while it runs, its result and files when it has ended. */

const EVENTS_SHOWN = 200;
const CARD_PADDING = 44; // px, both sides
const CHART_WIDTH = 760; // px, where there is room

function searchFacts(progress) {
  if (!known(progress.flights)) return [];
  return [
    ["Generation", show.count(progress.generation)],
    ["Best cost, rad²", show.cost(progress.best_cost)],
    ["Flights", show.count(progress.flights)],
    ["Flights per second", show.number(progress.flights_per_s)],
  ];
}

function headButton(job) {
  const act = async (path, method) => {
    try { await call(path, { method }); method === "DELETE" ? (location.hash = "#/") : route(); } catch (error) { view.prepend(problemCard(error)); }
  };
  if (FINAL.includes(job.status)) {
    return element("button", { class: "bad push", on: { click: () => confirm("Delete this job with its files?") && act(`/jobs/${job.id}`, "DELETE") } }, "Delete");
  }
  return element("button", { class: "bad push", disabled: job.status === "cancelling", on: { click: () => act(job.links.cancel, "POST") } }, "Cancel");
}

function headCard(job) {
  const progress = job.progress ?? {}, over = FINAL.includes(job.status);
  const from = job.started_at ? new Date(job.started_at) : null;
  const elapsed = from ? ((job.finished_at ? new Date(job.finished_at) : new Date()) - from) / 1000 : null;
  const title = element("h1", {}, `${job.operation}: ${job.request.aircraft ?? "aircraft"}`);
  return element(
    "section",
    { class: "card" },
    element("div", { class: "row" }, title, pill(job.status), job.partial ? element("span", { class: "soft" }, "best so far") : null, headButton(job)),
    element("div", { class: "soft mono" }, job.id),
    bar(job),
    over ? null : element("div", { class: "soft" }, progress.message ?? ""),
    facts([
      ...(job.label ? [["Label", job.label]] : []),
      ["Asked for", described(job)],
      ...(over || !progress.phase ? [] : [["Phase", progress.phase]]),
      ...searchFacts(progress),
      [over ? "Took" : "Running for", show.duration(elapsed)],
      ...(over ? [] : [["Remaining", show.duration(progress.eta_s)]]),
      ["Attempt", `${job.attempt} of ${job.max_attempts}`],
      ["Created", show.time(job.created_at)],
      ...(job.model_id ? [["Kept as", fileLink(`/models/${job.model_id}`, `${job.model_id}.json`, {}, "identified model")]] : []),
    ]),
  );
}

function eventsTable(log) {
  const rows = log.slice(-EVENTS_SHOWN).reverse().map(([name, data]) => [String(data.seq), name, show.time(data.at), data.message ?? data.error?.detail ?? data.reason ?? data.worker ?? ""]);
  return table(["#", "Event", "Time", "What"], rows, { stack: true });
}

async function jobView(id) {
  const points = []; // of the convergence: [generation, least cost]
  const log = [];
  let job = await call(`/jobs/${id}`), result = null;
  const head = element("div"), cards = element("div"), search = element("div"), files = element("div"), events = element("details", { class: "card" });
  const said = element("p", { class: "unseen", role: "status" });
  view.replaceChildren(said, head, cards, search, files, events);
  document.title = `${job.operation} ${job.label ?? id}: MorphID`;

  function addPoint(generation, cost) {
    while (points.at(-1)?.[0] >= generation) points.pop(); // a later attempt goes on from an earlier generation
    points.push([generation, cost]);
  }

  function draw() {
    if (said.textContent !== `Job ${job.status}`) said.textContent = `Job ${job.status}`;
    refill(head, headCard(job));
    const history = result?.search?.history?.map((step) => [step.generation, step.best_cost]); // whole, where events are few
    const chart = convergenceCard(history ?? points, Math.min(search.clientWidth - CARD_PADDING, CHART_WIDTH));
    refill(search, ...(chart ? [chart] : []));
    refill(events, element("summary", {}, `History (${count(log.length, "event")})`), eventsTable(log));
  }

  async function finish() {
    job = await call(`/jobs/${id}`);
    if (job.status === "succeeded" || job.partial) result = await call(job.links.result);
    draw();
    const { code, detail, hint, pointer } = job.error ?? {};
    const failure = job.error ? problemCard({ problem: { title: `Failed: ${code}`, detail, hint, pointer } }) : null;
    cards.replaceChildren(...[failure, ...(result ? resultCards(job.operation, result) : []), exportCard(job.model_id)].filter(Boolean));
    files.replaceChildren(...filesCards((await call(job.links.artifacts)).artifacts));
  }

  function onEvent(name, data) {
    log.push([name, data]);
    if (name === "progress") {
      job.progress = data;
      if (known(data.best_cost)) addPoint(data.generation ?? points.length, data.best_cost);
    }
    job.status = data.status;
    job.attempt = data.attempt;
    if (name === "started" && !job.started_at) job.started_at = data.at;
    if (FINAL.includes(name)) finish().catch((error) => cards.replaceChildren(problemCard(error)));
    redraw();
  }

  let pending = false;
  const redraw = () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  };
  draw();
  const source = follow(id, onEvent);
  const timer = setInterval(() => { if (!FINAL.includes(job.status)) redraw(); }, 1000);
  leave = () => { source.close(); clearInterval(timer); };
}
