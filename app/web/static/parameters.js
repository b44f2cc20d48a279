"use strict";
/* The parameters of an identified model with what the samples say about them. */

const AXES = ["flap", "torsion", "edgewise"];
const AERO = {
  lift_factor: "Lift factor",
  centre_shift_m: "Aerodynamic-centre offset, m",
  profile_drag: "Profile drag coefficient",
  lag_s: "Circulation lag, s",
};
const GROUPS = {
  division: "Share of the span",
  stiffness_nm_rad: "Stiffness, N m/rad",
  damping_nms_rad: "Damping, N m s/rad",
  aero: "Aerodynamic corrections",
};
const UNSEEN_SPREAD = 1; // of a search coordinate (a factor e of a stiffness): the samples say nothing beyond it

/* All parameters in groups: [[group, [{name, title, value}, ...]], ...]; names as in result.uncertainty. */
function parameterGroups(model) {
  const own = Array.isArray(model.division?.[0]); // each wing has parameters of its own
  const perWing = (values) => (own ? values : [values]);
  const mark = (wing) => (own ? [`wing_${wing + 1}.`, `wing ${wing + 1}, `] : ["", ""]);
  const shares = perWing(model.division).flatMap((parts, wing) => parts.map((value, i) => ({
    name: `${mark(wing)[0]}division.${i + 1}`, title: `${mark(wing)[1]}link ${i + 1}`, value,
  })));
  const joints = (field) => perWing(model[field] ?? []).flatMap((rows, wing) => (rows ?? []).flatMap((row, joint) => [row].flat().map((value, i) => {
    const axis = AXES[i] === "edgewise" ? "lag" : AXES[i]; // its name in documents
    return { name: `${mark(wing)[0]}${field}.joint_${joint + 1}.${axis}`, title: `${mark(wing)[1]}joint ${joint + 1}, ${AXES[i]}`, value };
  })));
  const aero = Object.entries(model.aero ?? {}).map(([name, value]) => ({ name, title: AERO[name] ?? name.replaceAll("_", " "), value }));
  const groups = { division: shares, stiffness_nm_rad: joints("stiffness_nm_rad"), damping_nms_rad: joints("damping_nms_rad"), aero };
  return Object.entries(groups).filter(([, rows]) => rows.length).map(([group, rows]) => [GROUPS[group], rows]);
}

/* A parameter's name for people: "stiffness_nm_rad.joint_1.lag" is "stiffness, joint 1, edgewise". */
function parameterTitle(name) {
  if (AERO[name]) return AERO[name].replace(/, [ms]$/, "").toLowerCase();
  const words = { stiffness_nm_rad: "stiffness", damping_nms_rad: "damping", lag: "edgewise", division: "share of the span", log_ratio: "share of the span" };
  return name.split(".").map((part) => words[part] ?? (/^\d+$/.test(part) ? `link ${part}` : part.replaceAll("_", " "))).join(", ");
}

/* Names of the parameters that the samples do not determine: no interval, or large parts of a direction without effect. */
function undeterminedNames(uncertainty) {
  const names = new Set();
  for (const [name, [low, high]] of Object.entries(uncertainty?.interval_95 ?? {})) {
    if (low === null && high === null) names.add(name);
  }
  for (const unseen of uncertainty?.unidentifiable ?? []) {
    if (typeof unseen === "string") names.add(unseen);
    for (const [name, part] of Object.entries(unseen.direction ?? {})) {
      if (unseen.spread === null || Math.abs(part) * unseen.spread > UNSEEN_SPREAD) names.add(name);
    }
  }
  return names;
}

/* Why a parameter has no interval or a doubtful one; null where there is nothing to say. */
function remark(name, result, undetermined) {
  const searched = result.search?.aero_coefficients;
  if (AERO[name] && searched && !searched.includes(name)) return "kept fixed, not searched";
  if (undetermined.has(name)) return "not determined: the samples fit about as well with another value";
  if (result.uncertainty?.at_bound?.includes(name)) return "at its bound: the best value may lie outside";
  return null;
}

function parameterRow({ name, title, value }, result, undetermined) {
  const interval = undetermined.has(name) ? null : result.uncertainty?.interval_95?.[name];
  const [shown, spread] = showMeasured(value, interval);
  const why = remark(name, result, undetermined);
  const told = [element("span", {}, title), why && element("small", {}, why)].filter(Boolean);
  return element(
    "tr",
    { class: undetermined.has(name) ? "undetermined" : null },
    element("th", { scope: "row" }, ...told), element("td", { class: "number" }, shown), element("td", { class: "number" }, spread),
  );
}

/* The identified model as a table; result: {model, uncertainty, search}, the last two where they are known. */
function modelCard(result, title = "Identified model") {
  const undetermined = undeterminedNames(result.uncertainty);
  const measured = Object.keys(result.uncertainty?.interval_95 ?? {}).length > 0;
  const heads = [["", null], ["Value", "number"], [measured ? "95 % interval" : "", "number"]];
  const head = element("thead", {}, element("tr", {}, ...heads.map(([text, kind]) => (text ? element("th", { scope: "col", class: kind }, text) : element("td")))));
  const bodies = parameterGroups(result.model).map(([group, rows]) => element(
    "tbody",
    {},
    element("tr", {}, element("th", { class: "group", scope: "rowgroup", colspan: 3 }, group)),
    ...rows.map((row) => parameterRow(row, result, undetermined)),
  ));
  return card(
    title, { help: "parameters" },
    element("p", { class: "soft" }, `${count(result.model.links_per_wing, "link")} per wing; joints and links are counted from the root.`),
    namesLine("At a bound", result.uncertainty?.at_bound),
    element("table", { class: "parameters" }, head, ...bodies),
  );
}

function namesLine(title, names) {
  return names?.length ? element("p", {}, element("b", {}, `${title}: `), names.map(parameterTitle).join("; ")) : null;
}
