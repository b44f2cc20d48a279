"use strict";
/* Three views: the list of jobs (#/), one job (#/jobs/ID), help (#/help); and a field for the API key when one is wanted. */

const view = document.getElementById("view");
const HEALTH_POLL_MS = 10000;
let leave = () => {}; // ends what the view that is shown keeps going

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
    element("p", { class: "soft" }, "It is kept in this tab only and deleted when the tab is closed. The operator makes keys with "), element("pre", { class: "mono" }, "morphid keys create --owner NAME --name PURPOSE"),
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

/* ---- help ---- */

function helpView(place) {
  view.replaceChildren(document.getElementById("help").content.cloneNode(true));
  document.title = "Help: MorphID";
  const section = place && document.getElementById(`help-${place}`);
  if (section) section.scrollIntoView();
  else scrollTo(0, 0);
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
  const [, kind, name] = /^#\/(jobs|help)(?:\/([A-Za-z0-9_]+))?$/.exec(location.hash) ?? [];
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === (kind === "help" ? "#/help" : "#/")) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  document.title = "Jobs: MorphID";
  try {
    if (kind === "help") helpView(name);
    else if (kind === "jobs" && name) await jobView(name);
    else await listView();
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
  if (sign.textContent !== told[1]) sign.textContent = told[1];
}

addEventListener("hashchange", route);
setInterval(health, HEALTH_POLL_MS);
session.onRefused = keyView;
health();
start();
