"use strict";
/* The parameters of an identified model with what the samples say about them. */

const AXES = ["flap", "torsion", "edgewise"];
const AERO = {
  lift_factor: "Lift factor",
  ac_offset_m: "Aerodynamic-centre offset, m",
  profile_drag: "Profile drag coefficient",
  lag_s: "Circulation lag, s",
  zero_lift_rad: "Zero-lift angle, rad",
  cm0: "Section moment coefficient",
};
const GROUPS = {
  division: "Share of the span",
  stiffness_nm_rad: "Stiffness, N m/rad",
  damping_nms_rad: "Damping, N m s/rad",
  aero: "Aerodynamic corrections",
};

/* A parameter's name today; results carry former names next to it (morphdata/renamed.py). */
const RENAMED = { centre_shift_m: "ac_offset_m", lag: "edgewise" };
function currentName(name) {
  const parts = name.split("."), last = parts.pop();
  return [...parts, RENAMED[last] ?? last].join(".");
}
const currentNames = (names) => [...new Set((names ?? []).map(currentName))];
const underCurrentNames = (values) => Object.fromEntries(Object.entries(values ?? {}).map(([name, value]) => [currentName(name), value]));

/* Who has parameters of its own: [[prefix of their names, the same for people, the parameters], ...]. */
function parameterSets(model) {
  const named = Object.entries(model.surfaces ?? {}).filter(([, own]) => !own.mirror_of);
  if (named.length) return named.map(([name, own]) => [`${name}.`, `${name}, `, own]);
  if (!Array.isArray(model.division?.[0])) return [["", "", model]];
  const own = (wing) => ({ division: model.division[wing], stiffness_nm_rad: model.stiffness_nm_rad?.[wing], damping_nms_rad: model.damping_nms_rad?.[wing] });
  return model.division.map((_, wing) => [`wing_${wing + 1}.`, `wing ${wing + 1}, `, own(wing)]);
}

/* All parameters in groups: [[group, [{name, title, value}, ...]], ...]; names as in result.uncertainty. */
function parameterGroups(model) {
  const sets = parameterSets(model);
  const shares = sets.flatMap(([prefix, of, own]) => own.division.map((value, i) => ({
    name: `${prefix}division.${i + 1}`, title: `${of}link ${i + 1}`, value,
  })));
  const joints = (field) => sets.flatMap(([prefix, of, own]) => (own[field] ?? []).flatMap((row, joint) => [row].flat().map((value, i) => {
    return { name: `${prefix}${field}.joint_${joint + 1}.${AXES[i]}`, title: `${of}joint ${joint + 1}, ${AXES[i]}`, value };
  })));
  const { lift_factors: apart, ...shared } = underCurrentNames(model.aero);
  const aero = Object.entries(shared).flatMap(([name, value]) => {
    const title = AERO[name] ?? name.replaceAll("_", " ");
    const each = sets.filter(([, , own]) => own[name] !== undefined); // corrections that each surface has
    const own = name === "lift_factor" ? Object.entries(apart ?? {}) : [];
    if (!each.length) return [{ name, title, value }, ...own.map(([of, value]) => ({ name: `${of}.${name}`, title: `${of}, ${title.toLowerCase()}`, value }))];
    return each.map(([prefix, of, own]) => ({ name: `${prefix}${name}`, title: `${of}${title.toLowerCase()}`, value: own[name] }));
  });
  const groups = { division: shares, stiffness_nm_rad: joints("stiffness_nm_rad"), damping_nms_rad: joints("damping_nms_rad"), aero };
  return Object.entries(groups).filter(([, rows]) => rows.length).map(([group, rows]) => [GROUPS[group], rows]);
}

/* A parameter's name for people: "stiffness_nm_rad.joint_1.edgewise" is "stiffness, joint 1, edgewise". */
function parameterTitle(name) {
  if (AERO[name]) return AERO[name].replace(/, (m|s|rad)$/, "").toLowerCase();
  const words = { stiffness_nm_rad: "stiffness", damping_nms_rad: "damping", division: "share of the span", log_ratio: "share of the span" };
  return name.split(".").map((part) => words[part] ?? (/^\d+$/.test(part) ? `link ${part}` : part.replaceAll("_", " "))).join(", ");
}

/* Names of the parameters that the samples do not determine. */
function undeterminedNames(uncertainty) {
  const open = Object.entries(underCurrentNames(uncertainty?.interval_95)).filter(([, [low, high]]) => low === null && high === null);
  return new Set([...currentNames(uncertainty?.undetermined), ...open.map(([name]) => name)]);
}

/* Why a parameter has no interval or a doubtful one; null where there is nothing to say. */
function remark(name, result, undetermined) {
  const searched = result.search?.aero_coefficients && currentNames(result.search.aero_coefficients);
  const kind = name.split(".").at(-1);
  if (AERO[kind] && searched && !searched.includes(kind)) return "kept fixed, not searched";
  const said = [
    undetermined.has(name) ? "not determined: the samples fit about as well with another value" : null,
    currentNames(result.uncertainty?.at_bound).includes(name) ? "at its bound: the best value may lie outside" : null,
  ];
  return said.filter(Boolean).join("; ") || null;
}

const COLUMNS_OF_PARAMETERS = 4;

/* A Cramer-Rao bound, per cent of the value: beyond ten times the value it says no more than that. */
function boundText(percent) {
  if (!known(percent)) return "";
  return percent > 1000 ? "> 1000" : show.number(percent, 2);
}

/* The row of a parameter, and one below it where there is something to say. */
function parameterRows({ name, title, value }, result, undetermined) {
  const [shown, spread] = showMeasured(value, underCurrentNames(result.uncertainty?.interval_95)[name]);
  const why = remark(name, result, undetermined), grey = undetermined.has(name) ? "undetermined" : "";
  const cells = [shown, spread, boundText(underCurrentNames(result.uncertainty?.cramer_rao_percent)[name])];
  const row = element("tr", { class: grey }, element("th", { scope: "row" }, title), ...cells.map((text) => element("td", { class: "number" }, text)));
  return why ? [row, element("tr", { class: "remark" }, element("td", { colspan: COLUMNS_OF_PARAMETERS }, why))] : [row];
}

/* The identified model as a table; result: {model, uncertainty, search}, the last two where they are known. The model
   is null where a search was stopped before it had found one that flies. */
function modelCard(result, title = "Identified model") {
  if (!result.model) return card(title, {}, element("p", {}, "None was found yet that flies the samples."));
  const undetermined = undeterminedNames(result.uncertainty);
  const measured = Object.keys(result.uncertainty?.interval_95 ?? {}).length > 0;
  const bounded = Object.keys(result.uncertainty?.cramer_rao_percent ?? {}).length > 0;
  const heads = [["", null], ["Value", "number"], [measured ? "95 % interval" : "", "number"], [bounded ? "Cramér–Rao, %" : "", "number"]];
  const head = element("thead", {}, element("tr", {}, ...heads.map(([text, kind]) => (text ? element("th", { scope: "col", class: kind }, text) : element("td")))));
  const bodies = parameterGroups(result.model).map(([group, rows]) => element(
    "tbody",
    {},
    element("tr", {}, element("th", { class: "group", scope: "rowgroup", colspan: COLUMNS_OF_PARAMETERS }, group)),
    ...rows.flatMap((row) => parameterRows(row, result, undetermined)),
  ));
  return card(
    title, { help: "parameters" },
    element("p", { class: "soft" }, `${perWing(result.model.links_per_wing)}; joints and links are counted from the root.`),
    namesLine("At a bound", currentNames(result.uncertainty?.at_bound)),
    element("table", { class: "parameters" }, head, ...bodies),
  );
}

function namesLine(title, names) {
  return names?.length ? element("p", {}, element("b", {}, `${title}: `), names.map(parameterTitle).join("; ")) : null;
}

/* ---- export ---- */

const FORMATS = document.body.dataset.formats.split(" ");

/* Fetch an exported file, however long its job takes; `say(text)` shows how far it is. */
async function fetchExport(path, say) {
  for (;;) {
    const answer = await request(path, { headers: { Accept: "*/*" } });
    if (answer.status !== 202) return answer;
    say("A job is writing the file …");
    await new Promise((wake) => setTimeout(wake, 1000 * Number(answer.headers.get("Retry-After") ?? 2)));
  }
}

/* The identified model as a file of each format. */
function exportCard(model) {
  if (!model) return null;
  const said = element("p", { class: "soft", role: "status" });
  const say = (text) => { said.textContent = text; };
  const save = async (format) => {
    say("");
    try {
      const answer = await fetchExport(`/models/${model}/export?format=${format}`, say);
      const [, name] = /filename="([^"]+)"/.exec(answer.headers.get("Content-Disposition"));
      const url = URL.createObjectURL(await answer.blob());
      element("a", { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
      say("");
    } catch (error) {
      say([error.message, error.problem?.hint].filter(Boolean).join(" "));
    }
  };
  const buttons = FORMATS.map((format) => element("button", { on: { click: () => save(format) } }, format));
  return card("Export the model", { help: "export" }, element("div", { class: "row" }, ...buttons), said);
}
