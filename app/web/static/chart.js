"use strict";
/* The convergence of a search: least cost so far over generations, on a logarithmic axis. */

const CHART = { height: 220, left: 56, right: 12, top: 12, bottom: 40, marks: 6, room: 1.1, dots: 60 };

/* Searches one after the other: a study begins anew with each number of links, and its cost then rises. */
function searches(points) {
  const lines = [];
  let last = Infinity;
  for (const point of points) {
    if (lines.length === 0 || point[1] > last) lines.push([]);
    lines.at(-1).push(point);
    last = point[1];
  }
  return lines;
}

/* Costs to mark between low and high: powers of ten where there are two or more, else round numbers. */
function costMarks(low, high) {
  const [first, last] = [Math.ceil(Math.log10(low)), Math.floor(Math.log10(high))];
  if (last > first) {
    const step = Math.ceil((last - first + 1) / CHART.marks);
    return Array.from({ length: Math.floor((last - first) / step) + 1 }, (_, i) => [10 ** (first + i * step), power(first + i * step)]);
  }
  const size = 10 ** magnitude(high - low);
  const step = [0.2, 0.5, 1, 2].map((part) => part * size).find((width) => (high - low) / width <= CHART.marks);
  const from = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - from + 1 }, (_, i) => [(from + i) * step, show.number((from + i) * step)]);
}

/* points: [[generation, cost], ...], costs above zero. width: what the card has room for, px. */
function convergenceChart(points, width) {
  const { height, left, right, top, bottom } = CHART;
  const costs = points.map(([, cost]) => cost);
  const low = Math.min(...costs) / CHART.room, high = Math.max(...costs) * CHART.room;
  const first = points[0][0], last = Math.max(points.at(-1)[0], first + 1);
  const x = (generation) => left + ((width - left - right) * (generation - first)) / (last - first);
  const y = (cost) => top + ((height - top - bottom) * Math.log(high / cost)) / Math.log(high / low);
  const label = `Least cost over ${last - first} generations: from ${show.cost(points[0][1])} to ${show.cost(points.at(-1)[1])} rad²`;
  const plot = svg("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label });
  for (const [cost, text] of costMarks(low, high)) {
    plot.append(svg("line", { class: "grid", x1: left, x2: width - right, y1: y(cost), y2: y(cost) }));
    plot.append(svg("text", { x: left - 6, y: y(cost) + 4, "text-anchor": "end" }, text));
  }
  const base = height - bottom + 16;
  plot.append(svg("text", { x: left, y: base }, String(first)), svg("text", { x: width - right, y: base, "text-anchor": "end" }, String(last)));
  plot.append(svg("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, "generation"));
  for (const line of searches(points)) {
    const corners = line.map(([generation, cost]) => `${x(generation).toFixed(1)},${y(cost).toFixed(1)}`);
    plot.append(svg("polyline", { class: "curve", points: corners.join(" ") }));
    for (const corner of points.length > CHART.dots ? [] : corners) plot.append(svg("circle", { class: "point", cx: corner.split(",")[0], cy: corner.split(",")[1], r: 2.5 }));
  }
  return plot;
}

/* The card of the chart; null where there is nothing to draw yet. */
function convergenceCard(points, width) {
  const drawn = points.filter(([, cost]) => known(cost) && cost > 0);
  if (drawn.length < 2) return null;
  return card("Convergence", { help: "convergence" }, element("p", { class: "soft" }, "Least cost so far, rad²"), convergenceChart(drawn, width));
}
