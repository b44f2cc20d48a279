"use strict";
/* What a job asks for in few words, and the cards of its result: one function for each operation. */

const number = (text) => ({ text, number: true });
const count = (value, unit) => `${value} ${unit}${value === 1 ? "" : "s"}`;
/* Links per wing: "4 links", or by surface "4 links of wing, 1 of tail". */
const linksText = (links) => (typeof links === "number" ? count(links, "link")
  : Object.entries(links).map(([name, own], i) => `${i ? own : count(own, "link")} of ${name}`).join(", "));
const perWing = (links) => (typeof links === "number" ? `${linksText(links)} per wing` : linksText(links));
const comparedText = (every) => (every.every((links) => typeof links === "number") ? `${every.join(", ")} links` : every.map(linksText).join("; "));
const ANGLES = [["phi", "φ"], ["theta", "θ"], ["psi", "ψ"]];
const LETTERS = Object.fromEntries(ANGLES);
const RMS_TITLES = ANGLES.map(([, letter]) => number(`RMS ${letter}, mrad`));

/* ---- requests in few words ---- */

const links = (asked) => (asked.links_per_wing ? linksText(asked.links_per_wing) : null);
const drives = (asked) => asked.drives?.join(", ").replaceAll("_", " ");
const DESCRIBED = {
  identify: (asked) => [drives(asked), links(asked), asked.method],
  study: (asked) => [drives(asked), comparedText(asked.compared_links), asked.method],
  simulate: (asked) => [drives(asked), `${asked.model} model`, links(asked), `${asked.duration_s} s`],
  optimize: (asked) => [drives(asked), `to ${show.number(asked.final_rad)} rad in ${asked.duration_s} s`, links(asked), asked.method],
  export: (asked) => [links(asked), asked.format],
};
const OPERATIONS = document.body.dataset.operations.split(" ");

function described(job) {
  const parts = DESCRIBED[job.operation]?.(job.request) ?? [];
  return parts.filter(Boolean).join(", ") || "–";
}

/* ---- cards ---- */

function warningsCard(warnings) {
  if (!warnings?.length) return null;
  const items = warnings.map(({ code, message, hint, pointer }) => element(
    "li",
    {},
    element("p", {}, message ?? code),
    hint ? element("p", {}, element("b", {}, "What to do: "), hint) : null,
    pointer ? pointerLine(pointer) : null,
  ));
  return card(count(warnings.length, "warning"), { help: "warnings", kind: "warnings" }, element("ul", {}, ...items));
}

const GRADES = {
  good: "The model may be used as it is.",
  usable: "The model may be used with the reservations below.",
  poor: "Do not rely on this model.",
  failed: "There is no model.",
};

/* Whether a model may be believed, why, and what to do next; null of results of earlier versions. */
function verdictCard(verdict, title = "Verdict") {
  if (!verdict) return null;
  const list = (sentences) => element("ul", {}, ...sentences.map((sentence) => element("li", {}, sentence)));
  const steps = verdict.next_steps ?? [];
  return card(
    title, { help: "verdict", kind: `verdict ${verdict.grade}` },
    element("p", { class: "row" }, grade(verdict), element("b", {}, GRADES[verdict.grade] ?? "")),
    list(verdict.reasons),
    ...(steps.length ? [element("p", {}, element("b", {}, "What to do next")), list(steps)] : []),
  );
}

function grade(verdict) {
  return element("span", { class: `pill ${verdict.grade}` }, verdict.grade);
}

/* Theil's coefficient with its parts, and what the residuals of each sample are like. */
function residualsCard(fits) {
  const share = (part) => (known(part) ? `${show.number(100 * part, 2)} %` : "–");
  const rows = fits.flatMap((fit) => Object.entries(fit.statistics ?? {}).filter(([, found]) => known(found.theil)).map(([channel, found]) => [
    fit.sample, LETTERS[channel] ?? channel.replaceAll("_", " "), show.number(found.theil, 2), share(found.theil_bias), share(found.theil_variance), share(found.theil_covariance),
    show.number(found.lag_1, 2), found.white === true ? "yes" : found.white === false ? "no" : "–", show.number(found.drive_correlation, 2),
  ]));
  if (!rows.length) return null;
  const titles = ["Sample", "Channel", ...["Theil's U", "bias", "variance", "covariance", "lag 1", "white", "with drives"].map(number)];
  return card("Residuals", { help: "residuals" }, table(titles, rows, { stack: true }));
}

function fitCard(fits, title = "Fit") {
  const share = (fit) => (known(fit.J_identified) && fit.J_rigid > 0 ? show.percent(fit.J_identified / fit.J_rigid) : "–");
  const rows = fits.map((fit) => [
    fit.sample, fit.role === "held_out" ? "held out" : fit.role, show.cost(fit.J_rigid), show.cost(fit.J_initial), show.cost(fit.J_identified),
    share(fit), ...ANGLES.map(([angle]) => show.milliradians(fit.rms_rad[angle])),
  ]);
  const titles = ["Sample", "Role", ...["J rigid, rad²", "J first guess, rad²", "J identified, rad²", "identified / rigid"].map(number), ...RMS_TITLES];
  return card(title, { help: "fit" }, table(titles, rows, { stack: true }));
}

function studyCards(result) {
  const chosen = result.rows.findIndex((row) => JSON.stringify(row.links_per_wing) === JSON.stringify(result.recommended?.links_per_wing));
  const rows = result.rows.map((row) => [
    linksText(row.links_per_wing), String(row.bodies), String(row.parameters), show.cost(row.J_train), show.cost(row.J_held_out),
    ...ANGLES.map(([angle]) => show.milliradians(row.rms_rad[angle])), show.milliseconds(row.flight_s), show.duration(row.identify_s), row.verdict ? grade(row.verdict) : "–",
  ]);
  const titles = ["Links per wing", ...["Bodies", "Unknowns", "J fitted, rad²", "J held out, rad²"].map(number), ...RMS_TITLES, ...["One flight, ms", "Identified in", "Verdict"].map(number)];
  const reason = result.recommended?.reason ? element("p", {}, `Recommended: ${result.recommended.reason}`) : null;
  const cards = [card("Accuracy and cost", { help: "study" }, reason, table(titles, rows, { marked: chosen, stack: true }))];
  if (chosen >= 0) {
    const row = result.rows[chosen];
    cards.push(...[verdictCard(row.verdict, `Verdict on ${perWing(row.links_per_wing)}`)].filter(Boolean));
    cards.push(fitCard(row.fit, `Fit with ${perWing(row.links_per_wing)}`), modelCard({ search: result.search, ...row }, "Recommended model"));
  }
  return cards;
}

const NOT_CHANNELS = ["time_s", "sweep_left_rad", "sweep_right_rad", "phi_rad", "theta_rad", "psi_rad"];

/* The range of every channel of a flight. */
function channelsCard(trajectory) {
  const least = (values) => values.reduce((a, b) => Math.min(a, b)), most = (values) => values.reduce((a, b) => Math.max(a, b));
  const columns = Object.entries(trajectory).filter(([name]) => !NOT_CHANNELS.includes(name));
  if (!columns.length) return null;
  const rows = columns.map(([name, values]) => [name, show.number(values[0]), show.number(least(values)), show.number(most(values)), show.number(values.at(-1))]);
  return card("Channels", { help: "channels" }, table(["Channel, with its unit", ...["start", "least", "greatest", "end"].map(number)], rows, { stack: true }));
}

function simulateCards(result) {
  const tips = result.trim.tip_z_m ?? {};
  const up = (side) => (known(tips[side]) ? show.number(-tips[side]) : "–");
  return [card(
    "Flight", { help: "flight" },
    facts([
      ["Model", result.model.kind],
      ["Angle of attack at the start, rad", show.number(result.trim.alpha_rad)],
      ...(result.trim.bank_rad ? [["Bank angle at the start, rad", show.number(result.trim.bank_rad)]] : []),
      ["Left tip at the start, m up", up("left")],
      ["Right tip at the start, m up", up("right")],
      ...ANGLES.map(([angle, letter]) => [`Largest departure of ${letter}, mrad`, show.milliradians(result.summary.max_abs_rad[angle])]),
      ["Attitude variation, rad²", show.cost(result.summary.variation_rad2)],
      ["Computed in", show.duration(result.cost.wall_s)],
      ["Times faster than real time", show.number(result.cost.real_time_factor)],
    ]),
  ), channelsCard(result.trajectory)];
}

const SCHEDULES = [["constant", "constant rate"], ["rigid_optimum", "optimum of the rigid model"], ["optimum", "optimum"]];
const FLOWN_IN = ["rigid", "equivalent", "flexible"];

/* What the optimum reaches of each limit, and the limit itself. */
const LIMITS = [["max_rate_rad_s", "Largest rate, rad/s"], ["max_accel_rad_s2", "Largest acceleration, rad/s²"], ["max_hinge_torque_nm", "Largest hinge torque, N m"]];

function limitFacts(result) {
  const reached = result.reached?.optimum ?? {};
  return LIMITS.filter(([name]) => known(reached[name])).map(([name, title]) => {
    const limit = result.limits[name];
    return [title, show.number(reached[name]) + (known(limit) ? ` of ${show.number(limit)}` : "")];
  });
}

function reductionSentence(result) {
  const reduction = result.reduction_percent;
  if (!known(reduction)) return null;
  const where = result.reduction_model ? `, flown in the ${result.reduction_model} model` : "";
  return element("p", {}, `The optimum varies ${show.number(Math.abs(reduction))} per cent ${reduction < 0 ? "more" : "less"} than the constant rate${where}.`);
}

/* The knots of a schedule; null stands for a search that was stopped before it had flown one to its end. */
function knotTable(schedule) {
  if (!schedule) return element("p", {}, "None was found yet that flies to its end.");
  const knots = schedule.knot_time_s.map((time, i) => [String(i + 1), show.number(time), show.number(schedule.knot_sweep_rad[i])]);
  const drive = (schedule.drive ?? "sweep").replaceAll("_", " ");
  return table(["Knot", "time, s", `${drive}, rad`].map(number), knots, { wide: false });
}

function optimizeCards(result) {
  const rows = SCHEDULES.filter(([name]) => result.variation[name]).map(([name, title]) => [title, ...FLOWN_IN.map((model) => show.cost(result.variation[name][model]))]);
  const titles = ["Schedule", ...FLOWN_IN.map((model) => number(`flown in the ${model} model`))];
  const marked = rows.findIndex(([title]) => title === "optimum");
  const notes = (result.notes ?? []).map((note) => element("p", { class: "soft" }, note));
  const cards = [
    card("Attitude variation, rad²", { help: "schedule" }, reductionSentence(result), table(titles, rows, { marked, stack: true }), ...notes),
    card("Schedule", { help: "schedule" }, knotTable(result.schedule), facts(limitFacts(result))),
  ];
  if (result.pareto?.length) {
    const front = result.pareto.map((point) => [show.number(point.duration_s), show.cost(point.variation_rad2), show.cost(point.constant_rad2)]);
    cards.push(card("Duration against variation", { help: "schedule" }, table(["duration, s", "variation, rad²", "at constant rate, rad²"].map(number), front, { wide: false })));
  }
  return cards;
}

function exportCards(result) {
  return [card("Exported model", { help: "export" }, facts([["Format", result.format], ["File", result.file], ["Size", show.bytes(result.size_bytes)], ["SHA-256", result.sha256]]))];
}

const RESULT_CARDS = {
  identify: (result) => [fitCard(result.fit), modelCard(result), residualsCard(result.fit)],
  study: studyCards,
  simulate: simulateCards,
  optimize: optimizeCards,
  export: exportCards,
};

function resultCards(operation, result) {
  return [verdictCard(result.verdict), warningsCard(result.warnings), ...(RESULT_CARDS[operation]?.(result) ?? [])].filter(Boolean);
}

/* ---- files ---- */

const DRAWN_HERE = "convergence.svg"; // the page has its own chart of this

function filesCards(files) {
  const plots = files.filter((file) => file.name.endsWith(".svg") && file.name !== DRAWN_HERE);
  const title = (file) => file.name.replace(".svg", "").replaceAll("_", " ");
  const figures = plots.map((file) => element(
    "figure",
    {},
    fileLink(file.href, file.name, { target: "_blank" }, showImage(element("img", { alt: title(file), loading: "lazy" }), file.href)),
    element("figcaption", {}, title(file)),
  ));
  const downloads = files.map((file) => fileLink(file.href, file.name, { download: file.name }, `${file.name} (${show.bytes(file.size_bytes)})`));
  return [
    figures.length ? card("Plots", {}, element("div", { class: "plots" }, ...figures)) : null,
    downloads.length ? card("Files", {}, element("div", { class: "files" }, ...downloads)) : null,
  ].filter(Boolean);
}
