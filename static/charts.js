// Lays an interactive chart over each drawing that came with the page, from the table behind it.
// Without this script, and on paper, the drawing stays.
"use strict";

const DAY_S = 86400;
const HINTS = "Point at a mark to read it. Drag to look closer, double-click to see all.";

function rowsOf(figure) {
  const rows = [...figure.querySelectorAll("tr[data-x]")].map((row) => ({
    x: Number(row.dataset.x),
    y: Number(row.dataset.y),
    decimals: Number(row.dataset.decimals),
    label: row.dataset.label,
    isMarked: "marked" in row.dataset,
  }));
  return rows.sort((a, b) => a.x - b.x);
}

function inks() {
  const style = getComputedStyle(document.documentElement);
  const ink = (name) => style.getPropertyValue(name).trim();
  return { accent: ink("--accent"), quiet: ink("--quiet"), hair: ink("--hair"), rule: ink("--rule"), ground: ink("--ground") };
}

const shortly = (_, values) => values.map((v) => (v === null ? "" : String(Number(v.toPrecision(2)))));

// 1, 2, 5, 10, …: what the drawing has at its left as well.
function roundSteps(low, high) {
  const steps = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
    for (const factor of [1, 2, 5]) {
      const step = factor * 10 ** power;
      if (step >= low && step <= high) steps.push(step);
    }
  }
  return steps;
}

// From the last round step at or below to the first at or above; without it there would be whole decades.
function roundRange(low, high) {
  if (low === null) return [1, 10];
  const first = roundSteps(low / 10, low).at(-1);
  return [first, roundSteps(Math.max(high, first * 1.01), 10 * high).at(0)];
}

function options(figure, rows, reading, box) {
  const ink = inks();
  const isTime = figure.dataset.chart === "progress";
  const font = `11px ${getComputedStyle(document.body).fontFamily}`;
  // Every round number is written; by itself the library leaves out most of those between decades.
  const axis = { stroke: ink.quiet, font, filter: (_, steps) => steps, grid: { stroke: ink.hair, width: 1 }, ticks: { stroke: ink.hair, width: 1 } };
  const two = (v) => String(v).padStart(2, "0");
  const date = (s, isLong) => {
    const at = new Date(s * 1000);
    const month = `${at.getUTCFullYear()}-${two(at.getUTCMonth() + 1)}`;
    return isLong ? month : `${month}-${two(at.getUTCDate())}`;
  };
  const dates = (_, moments) => moments.map((s) => date(s, moments.at(-1) - moments[0] > 150 * DAY_S));
  // One day alone gets a month around it; else there would be years of nothing.
  const first = rows[0].x;
  const last = rows.at(-1).x;
  const isOneDay = first === last;
  // A mark at an end stands off it; what was drawn closer is shown as it was drawn.
  const margin = isOneDay ? 15 * DAY_S : 0.04 * (last - first);
  const isWhole = (low, high) => low <= first && high >= last;
  const around = (_, low, high) => (isWhole(low, high) ? [first - margin, last + margin] : [low, high]);
  const aroundLog = (_, low, high) => (isWhole(low, high) ? roundRange(first, last) : [low, high]);
  const splits = (_, __, low, high) => roundSteps(low, high);
  return {
    width: box.clientWidth,
    height: box.clientHeight,
    // Room for the half of the last label that stands beyond the axis.
    padding: [null, isTime ? 36 : 16, null, null],
    tzDate: (s) => uPlot.tzDate(new Date(s * 1000), "UTC"),
    legend: { show: false },
    cursor: { y: false, points: { size: 11, width: 2, stroke: ink.accent, fill: "transparent" } },
    scales: { x: isTime ? { time: true, range: around } : { time: false, distr: 3, range: aroundLog }, y: { distr: 3, range: (_, low, high) => roundRange(low, high) } },
    axes: [
      { ...axis, grid: { show: false }, space: isTime ? 85 : 30, values: isTime ? dates : shortly, ...(isTime ? {} : { splits }) },
      { ...axis, size: 42, splits, values: shortly },
    ],
    series: [
      {},
      { paths: () => null, points: { show: true, size: 8, width: 1.5, stroke: ink.rule, fill: ink.ground } },
      { stroke: ink.accent, width: 1.5, spanGaps: true, paths: uPlot.paths.stepped({ align: 1 }), points: { show: true, size: 8, width: 1, stroke: ink.ground, fill: ink.accent } },
    ],
    hooks: {
      setCursor: [
        (chart) => {
          const row = rows[chart.cursor.idx ?? -1];
          reading.textContent = row ? `${row.label}: MiD ${row.y.toFixed(row.decimals)}` : HINTS;
        },
      ],
    },
  };
}

function enliven(figure) {
  const box = figure.querySelector(".plot");
  const rows = rowsOf(figure);
  if (rows.length < 2) return;
  const reading = figure.querySelector(".reading");
  reading.textContent = HINTS;
  const data = [rows.map((r) => r.x), rows.map((r) => r.y), rows.map((r) => (r.isMarked ? r.y : null))];
  let chart;
  const draw = () => {
    chart?.destroy();
    chart = new uPlot(options(figure, rows, reading, box), data, box);
    chart.root.setAttribute("aria-hidden", "true");
  };
  draw();
  box.classList.add("is-live");
  new ResizeObserver(() => chart.setSize({ width: box.clientWidth, height: box.clientHeight })).observe(box);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

document.querySelectorAll("figure[data-chart=progress], figure[data-chart=latency]").forEach(enliven);
