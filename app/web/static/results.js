"use strict";
/* What a job asks for in few words, and the cards of its result: one function for each operation. */

const number = (text) => ({ text, number: true });
const count = (value, unit) => `${value} ${unit}${value === 1 ? "" : "s"}`;
const ANGLES = [["phi", "φ"], ["theta", "θ"], ["psi", "ψ"]];

/* ---- requests in few words ---- */

const links = (asked) => (asked.links_per_wing ? count(asked.links_per_wing, "link") : null);
const DESCRIBED = {
  identify: (asked) => [links(asked), asked.method],
  study: (asked) => [`${asked.compared_links.join(", ")} links`, asked.method],
  simulate: (asked) => [`${asked.model} model`, links(asked), `${asked.duration_s} s`],
  optimize: (asked) => [`to ${asked.final_rad} rad in ${asked.duration_s} s`, links(asked), asked.method],
};

function described(job) {
  const parts = DESCRIBED[job.operation]?.(job.request) ?? [];
  return parts.filter(Boolean).join(", ") || "–";
}

/* ---- cards ---- */

function facts(entries) {
  return element("dl", { class: "facts" }, ...entries.map(([title, value]) => element("div", {}, element("dt", {}, title), element("dd", {}, value))));
}

function narrow(table) {
  table.classList.add("narrow");
  return table;
}

function card(title, ...content) {
  return element("section", { class: "card" }, element("h2", {}, title), ...content);
}

function fitCard(fits, title = "Fit") {
  const rows = fits.map((fit) => [
    fit.sample, fit.role === "held_out" ? "held out" : fit.role, show.number(fit.J_rigid), show.number(fit.J_initial), show.number(fit.J_identified),
    show.number(fit.J_identified / fit.J_rigid, 2), ...ANGLES.map(([angle]) => show.milliradians(fit.rms_rad[angle])),
  ]);
  const titles = ["Sample", "Role", ...["J rigid", "J first guess", "J identified", "ratio", ...ANGLES.map(([, letter]) => `RMS ${letter}, mrad`)].map(number)];
  return card(title, table(titles, rows));
}

function modelCard(model, title = "Identified model") {
  const triples = (rows) => (Array.isArray(rows) ? rows : []).map((row, i) => [`joint ${i + 1}`, ...[row].flat(2).map((value) => show.number(value))]);
  const wide = Math.max(4, ...triples(model.stiffness_nm_rad).map((row) => row.length));
  const titles = ["", ...["flap", "torsion", "lag"].map(number)];
  while (titles.length < wide) titles.push(number(""));
  const aero = Object.entries(model.aero ?? {}).map(([name, value]) => [name.replaceAll("_", " "), typeof value === "number" ? show.number(value) : JSON.stringify(value)]);
  return card(
    title,
    facts([["Links per wing", String(model.links_per_wing)], ["Division of the span", [model.division].flat(2).map((part) => show.number(part)).join(" : ")], ...aero]),
    element("p", { class: "soft" }, "Stiffness, N m/rad"), table(titles, triples(model.stiffness_nm_rad)),
    element("p", { class: "soft" }, "Damping, N m s/rad"), table(titles, triples(model.damping_nms_rad)),
  );
}

function studyCards(result) {
  const chosen = result.rows.findIndex((row) => row.links_per_wing === result.recommended?.links_per_wing);
  const rows = result.rows.map((row) => [
    String(row.links_per_wing), String(row.bodies), String(row.parameters), show.number(row.J_train), show.number(row.J_held_out),
    ...ANGLES.map(([angle]) => show.milliradians(row.rms_rad[angle])), show.milliseconds(row.flight_s), show.duration(row.identify_s),
  ]);
  const titles = ["Links", "Bodies", "Unknowns", "J fitted", "J held out", ...ANGLES.map(([, letter]) => `RMS ${letter}, mrad`), "One flight, ms", "Identified in"].map(number);
  const reason = result.recommended?.reason ? element("p", {}, `Recommended: ${result.recommended.reason}`) : null;
  const cards = [card("Accuracy and cost", table(titles, rows, chosen), reason)];
  if (chosen >= 0) {
    const row = result.rows[chosen];
    cards.push(fitCard(row.fit, `Fit with ${count(row.links_per_wing, "link")} per wing`), modelCard(row.model, "Recommended model"));
  }
  return cards;
}

function simulateCards(result) {
  const tips = result.trim.tip_z_m ?? {};
  const up = (side) => (tips[side] === null || tips[side] === undefined ? "–" : show.number(-tips[side]));
  return [card(
    "Flight",
    facts([
      ["Model", result.model.kind],
      ["Angle of attack at the start, rad", show.number(result.trim.alpha_rad)],
      ["Left tip at the start, m up", up("left")],
      ["Right tip at the start, m up", up("right")],
      ...ANGLES.map(([angle, letter]) => [`Largest departure of ${letter}, mrad`, show.milliradians(result.summary.max_abs_rad[angle])]),
      ["Attitude variation, rad²", show.number(result.summary.variation_rad2)],
      ["Computed in", show.duration(result.cost.wall_s)],
      ["Times faster than real time", show.number(result.cost.real_time_factor)],
    ]),
  )];
}

const SCHEDULES = [["constant", "constant rate"], ["rigid_optimum", "optimum of the rigid model"], ["optimum", "optimum"]];
const FLOWN_IN = ["rigid", "equivalent", "flexible"];

/* What the optimum reaches of each limit, and the limit itself. */
const LIMITS = [["max_rate_rad_s", "Largest rate, rad/s"], ["max_accel_rad_s2", "Largest acceleration, rad/s²"], ["max_hinge_torque_nm", "Largest hinge torque, N m"]];

function limitFacts(result) {
  const reached = result.reached?.optimum ?? {};
  return LIMITS.filter(([name]) => reached[name] !== null && reached[name] !== undefined).map(([name, title]) => {
    const limit = result.limits[name];
    return [title, show.number(reached[name]) + (limit === null || limit === undefined ? "" : ` of ${show.number(limit)}`)];
  });
}

function reductionSentence(result) {
  const reduction = result.reduction_percent;
  if (reduction === null || reduction === undefined) return null;
  const where = result.reduction_model ? `, flown in the ${result.reduction_model} model` : "";
  return element("p", {}, `The optimum varies ${show.number(Math.abs(reduction))} per cent ${reduction < 0 ? "more" : "less"} than the constant rate${where}.`);
}

function optimizeCards(result) {
  const rows = SCHEDULES.filter(([name]) => result.variation[name]).map(([name, title]) => [title, ...FLOWN_IN.map((model) => show.number(result.variation[name][model]))]);
  const titles = ["Schedule", ...FLOWN_IN.map((model) => number(`flown in the ${model} model`))];
  const marked = rows.findIndex(([title]) => title === "optimum");
  const knots = result.schedule.knot_time_s.map((time, i) => [String(i + 1), show.number(time), show.number(result.schedule.knot_sweep_rad[i])]);
  const notes = (result.notes ?? []).map((note) => element("p", { class: "soft" }, note));
  const cards = [
    card("Attitude variation, rad²", table(titles, rows, marked), reductionSentence(result), ...notes),
    card("Schedule", narrow(table(["Knot", "time, s", "sweep, rad"].map(number), knots)), facts(limitFacts(result))),
  ];
  if (result.pareto?.length) {
    const front = result.pareto.map((point) => [point.duration_s, point.variation_rad2, point.constant_rad2].map((value) => show.number(value)));
    cards.push(card("Duration against variation", narrow(table(["duration, s", "variation, rad²", "at constant rate, rad²"].map(number), front))));
  }
  return cards;
}

const RESULT_CARDS = {
  identify: (result) => [fitCard(result.fit), modelCard(result.model)],
  study: studyCards,
  simulate: simulateCards,
  optimize: optimizeCards,
};

function resultCards(operation, result) {
  return RESULT_CARDS[operation]?.(result) ?? [];
}

function filesCards(files) {
  const plots = files.filter((file) => file.name.endsWith(".svg"));
  const figures = plots.map((file) => element("figure", {}, fileLink(file.href, file.name, { target: "_blank" }, showImage(element("img", { alt: file.name, loading: "lazy" }), file.href)), element("figcaption", {}, file.name.replace(".svg", "").replaceAll("_", " "))));
  const downloads = files.map((file) => fileLink(file.href, file.name, { download: file.name }, `${file.name} (${show.bytes(file.size_bytes)})`));
  return [
    figures.length ? card("Plots", element("div", { class: "plots" }, ...figures)) : null,
    downloads.length ? card("Files", element("div", { class: "files" }, ...downloads)) : null,
  ].filter(Boolean);
}
