// One quantity over another as a picture (SVG): the track, the height profile, and any two channels.
"use strict";
const pairs = (() => {
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const MARGIN = { left: 66, right: 14, top: 8, bottom: 38 };

  function element(name, attributes, parent, text) {
    const made = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text != null) made.textContent = text;
    parent.append(made);
    return made;
  }

  function ends(values) {
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) if (value != null) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(high >= low)) return [0, 1];
    const room = high > low ? 0.05 * (high - low) : 0.1 * Math.abs(low) || 1;
    return [low - room, high + room];
  }

  // Round numbers between two ends, about `count` of them.
  function ticks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((n) => n * power).find((size) => size >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k += 1) found.push(k * step);
    return found;
  }

  // Replace the picture in `figure`. time, x, y: values of the samples, null where there is none; equal: one scale on both axes.
  function draw(figure, { time, x, y, xLabel, yLabel, equal = false }) {
    figure.querySelector("svg")?.remove();
    figure.querySelector("output")?.remove();
    const width = Math.max(280, Math.min(figure.clientWidth, 620)), height = Math.round(equal ? 0.75 * width : 0.55 * width);
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", class: "pair" }, figure);
    let [[x0, x1], [y0, y1]] = [ends(x), ends(y)];
    const inner = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
    if (equal) {
      const size = Math.max((x1 - x0) / inner[0], (y1 - y0) / inner[1]);
      [x0, x1] = [(x0 + x1 - size * inner[0]) / 2, (x0 + x1 + size * inner[0]) / 2];
      [y0, y1] = [(y0 + y1 - size * inner[1]) / 2, (y0 + y1 + size * inner[1]) / 2];
    }
    const across = (value) => MARGIN.left + (inner[0] * (value - x0)) / (x1 - x0);
    const up = (value) => MARGIN.top + inner[1] * (1 - (value - y0) / (y1 - y0));
    const [right, bottom] = [MARGIN.left + inner[0], MARGIN.top + inner[1]];
    for (const tick of ticks(x0, x1, inner[0] / 80)) {
      element("line", { x1: across(tick), x2: across(tick), y1: MARGIN.top, y2: bottom, class: "grid" }, svg);
      element("text", { x: across(tick), y: bottom + 15, "text-anchor": "middle" }, svg, plots.shown(tick));
    }
    for (const tick of ticks(y0, y1, inner[1] / 40)) {
      element("line", { x1: MARGIN.left, x2: right, y1: up(tick), y2: up(tick), class: "grid" }, svg);
      element("text", { x: MARGIN.left - 6, y: up(tick) + 4, "text-anchor": "end" }, svg, plots.shown(tick));
    }
    element("text", { x: (MARGIN.left + right) / 2, y: height - 4, "text-anchor": "middle" }, svg, xLabel);
    element("text", { x: 12, y: (MARGIN.top + bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(MARGIN.top + bottom) / 2})` }, svg, yLabel);
    let path = "", pen = "M";
    x.forEach((value, k) => {
      if (value == null || y[k] == null) { pen = "M"; return; }
      path += `${pen}${across(value).toFixed(1)} ${up(y[k]).toFixed(1)}`;
      pen = "L";
    });
    element("path", { d: path, class: "curve" }, svg);
    const whole = x.map((value, k) => k).filter((k) => x[k] != null && y[k] != null);
    if (whole.length) {
      const mark = (k, name) => element("circle", { cx: across(x[k]), cy: up(y[k]), r: 4.5, class: name }, svg);
      mark(whole[0], "start");
      mark(whole.at(-1), "end");
      const spot = element("circle", { r: 4.5, class: "spot", visibility: "hidden" }, svg);
      const read = document.createElement("output");
      read.className = "soft";
      read.textContent = "filled: start, hollow: end";
      figure.append(read);
      svg.addEventListener("pointermove", (event) => {
        const box = svg.getBoundingClientRect();
        const [px, py] = [((event.clientX - box.left) * width) / box.width, ((event.clientY - box.top) * height) / box.height];
        let [nearest, least] = [whole[0], Infinity];
        for (const k of whole) {
          const away = (across(x[k]) - px) ** 2 + (up(y[k]) - py) ** 2;
          if (away < least) [nearest, least] = [k, away];
        }
        spot.setAttribute("cx", across(x[nearest]));
        spot.setAttribute("cy", up(y[nearest]));
        spot.setAttribute("visibility", "visible");
        read.textContent = `${time[nearest].toFixed(2)} s: ${xLabel} ${plots.shown(x[nearest])}, ${yLabel} ${plots.shown(y[nearest])}`;
      });
    }
    svg.setAttribute("aria-label", `${yLabel} over ${xLabel}: ${whole.length} samples`);
  }
  return { draw };
})();
