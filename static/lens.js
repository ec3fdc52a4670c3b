// The contact lens of a comparison: a slider over the time to contact, a vehicle that grows, and each method's error.
// All numbers stand in the table of the page; between the middles of its ranges errors are drawn on straight lines.
"use strict";

(() => {
  const lens = document.getElementById("lens");
  const [slider, speed, time, vehicle] = ["slider", "speed", "time", "vehicle"].map((name) =>
    document.getElementById(`lens-${name}`),
  );
  const rows = [...document.querySelectorAll("#lens-table tbody tr")].map(({ dataset, cells }) => ({
    middle: (Number(dataset.low) + Number(dataset.high)) / 2,
    seconds: [...cells].slice(1).map((cell) => (cell.dataset.seconds ? Number(cell.dataset.seconds) : null)),
  }));
  const curves = [...lens.querySelectorAll("dl > div")].map((entry, i) => ({
    meter: entry.querySelector("meter"),
    text: entry.querySelector("dd span"),
    points: rows
      .filter(({ seconds }) => seconds[i] !== null)
      .map(({ middle, seconds }) => [middle, seconds[i]])
      .reverse(),
  }));
  const NEAREST_S = 1; // below it the vehicle would fill the scene

  function errorAt(points, at) {
    const after = points.findIndex(([middle]) => middle >= at);
    if (after === 0) return (points[0][1] * at) / points[0][0]; // a relative error: none at contact
    if (after < 0) return points.at(-1)[1];
    const [[x0, y0], [x1, y1]] = [points[after - 1], points[after]];
    return y0 + ((at - x0) / (x1 - x0)) * (y1 - y0);
  }

  function draw() {
    const at = slider.max - slider.value; // contact is at the right
    time.textContent = `${at.toFixed(1)} s`;
    slider.setAttribute("aria-valuetext", `${at.toFixed(1)} seconds`);
    const size = 2 / Math.max(at, NEAREST_S); // the size in a picture is the reciprocal of the distance
    vehicle.setAttribute("transform", `translate(160 ${90 + 42 * Math.min(1.9, size)}) scale(${size})`);
    for (const { meter, text, points } of curves) {
      if (!points.length) continue;
      const error = errorAt(points, at);
      meter.value = at ? error / at : 0;
      text.textContent = `${error.toFixed(2)} s, ${((error * Number(speed.value)) / 3.6).toFixed(1)} m`;
    }
  }

  // One scale for all: the largest share of the time that is left, up to whole 5 %.
  const shares = curves.flatMap(({ points }) => points.map(([middle, seconds]) => seconds / middle));
  const full = Math.min(1, Math.ceil(20 * Math.max(...shares)) / 20);
  for (const { meter } of curves) meter.max = full;
  document.getElementById("lens-full").textContent = `${Math.round(100 * full)}%`;
  slider.addEventListener("input", draw);
  speed.addEventListener("change", draw);
  for (const part of lens.querySelectorAll("[hidden]")) part.hidden = false;
  draw();
})();
