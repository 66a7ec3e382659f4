// Panels of curves that share their x axis, drawn by uPlot. Colours are those of the reports: the style sheet says them.
"use strict";
const plots = (() => {
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const font = "12px " + getComputedStyle(document.body).fontFamily;
  const shown = (value) => (value == null || !isFinite(value) ? "–" : Number(value.toPrecision(5)).toString().replace("-", "−"));

  // Curves keep the colours they were drawn in: printed from a dark scheme, panels stay dark (console.css).
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const mark = () => document.documentElement.classList.toggle("dark", scheme.matches);
  scheme.addEventListener("change", mark);
  mark();

  const HEIGHT = 170;
  const ticked = (_, ticks) => ticks.map((tick) => (tick == null ? "" : shown(tick)));

  // The range of an axis with a little room, also around a value that never changes.
  function roomy(low, high) {
    if (low == null || high == null) return [0, 1];
    const room = high > low ? 0.06 * (high - low) : 0.1 * Math.abs(low) || 1;
    return [low - room, high + room];
  }

  // Values that are no number are gaps.
  const column = (values, factor) => Array.from(values, (value) => (Number.isFinite(value) ? value * factor : null));

  const shade = (stretches) => (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.fillStyle = colour("flagged");
    for (const [from, to] of stretches()) {
      const left = Math.max(u.valToPos(from, "x", true), bbox.left);
      const right = Math.min(Math.max(u.valToPos(to, "x", true), left + 1), bbox.left + bbox.width);
      if (right > left) ctx.fillRect(left, bbox.top, right - left, bbox.height);
    }
    ctx.restore();
  };

  // A panel below `parent`. lines: [{label, colour, width, dash}]; bands as uPlot takes them; zoomed(from, to) and whole() are asked.
  function panel(parent, title, xLabel, lines, { key, bands = [], zoomed, whole }) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const place = document.createElement("div");
    caption.textContent = title;
    place.className = "plot";
    place.setAttribute("role", "img");
    figure.append(caption, place);
    parent.append(figure);
    let stretches = [];
    const axis = { font, stroke: colour("soft"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("line"), width: 1, size: 4 } };
    const u = new uPlot(
      {
        width: Math.max(place.clientWidth, 200),
        height: HEIGHT,
        legend: { show: false },
        scales: { x: { time: false }, y: { range: (_, low, high) => roomy(low, high) } },
        axes: [
          { ...axis, size: 24, gap: 2, label: xLabel, labelSize: 16, labelFont: font, labelGap: 0, values: ticked },
          { ...axis, size: 62, space: 24, values: ticked },
        ],
        series: [{}, ...lines.map((line) => ({ stroke: line.colour, width: line.width, dash: line.dash, fill: line.fill, points: { show: false } }))],
        bands,
        cursor: {
          sync: { key },
          drag: { x: Boolean(zoomed), y: false, setScale: false },
          points: { size: 5 },
          bind: { dblclick: () => () => whole && whole() },
        },
        hooks: {
          drawClear: [shade(() => stretches)],
          setSelect: [(self) => {
            if (!zoomed || self.select.width < 4) return;
            zoomed(self.posToVal(self.select.left, "x"), self.posToVal(self.select.left + self.select.width, "x"));
          }],
          setCursor: [(self) => {
            const at = self.cursor.idx;
            const values = at == null ? "" : lines.map((line, k) => [line.label, self.data[k + 1][at]])
              .filter(([label, value]) => label && value != null).map(([label, value]) => `${label} ${shown(value)}`).join(", ");
            caption.textContent = values ? `${title}   ${shown(self.data[0][at])}: ${values}` : title;
          }],
        },
      },
      [[], ...lines.map(() => [])],
      place,
    );
    new ResizeObserver(() => {
      if (place.clientWidth && place.clientWidth !== u.width) u.setSize({ width: place.clientWidth, height: HEIGHT });
    }).observe(place);
    return {
      figure,
      // data: x and as many columns as lines; from, to: what the x axis shows; flagged: stretches of x to shade.
      show(data, from, to, flagged = []) {
        stretches = flagged;
        u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
        u.batch(() => { u.setData(data, true); u.setScale("x", { min: from, max: to }); });
        const values = data.slice(1).flat().filter((value) => value != null);
        const [low, high] = values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
        place.setAttribute("aria-label", values.length ? `${title}: from ${shown(low)} to ${shown(high)}` : `${title}: no value`);
      },
      remove() { u.destroy(); figure.remove(); },
    };
  }

  // What a refused request says, as one sentence.
  async function complaint(response) {
    try {
      const { error } = await response.json();
      return [error.where, error.what, error.remedy].filter(Boolean).join(": ");
    } catch { return `${response.status} ${response.statusText}`; }
  }
  return { colour, column, complaint, panel, shown };
})();
