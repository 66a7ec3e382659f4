// A flight's record: the server is asked for as many samples as the screen shows, again for every stretch of time.
"use strict";
(() => {
  const root = document.getElementById("record");
  if (!root) return;
  const [first, last] = [Number(root.dataset.start), Number(root.dataset.end)];
  const said = document.getElementById("said");
  const fields = { from: document.getElementById("from"), to: document.getElementById("to") };
  const place = document.getElementById("panels");
  const look = {
    measured: { colour: plots.colour("measured"), width: 1.5, label: "measured" },
    reconstructed: { colour: plots.colour("flight"), width: 1, label: "reconstructed" },
    flight: { colour: plots.colour("flight"), width: 1, label: "flight" },
    database: { colour: plots.colour("database"), width: 1.25, dash: [6, 3], label: "database" },
  };
  let from = first, to = last, asked = 0, panels = new Map();

  // uint32 length of the heading, the heading, then float64 time and values of each line.
  function unpacked(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const heading = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let offset = 4 + length;
    const next = (n) => { const part = new Float64Array(buffer, offset, n); offset += 8 * n; return part; };
    for (const line of heading.series) { line.time = next(line.samples); line.values = next(line.samples); }
    return heading;
  }

  function draw(heading) {
    const groups = new Map();
    for (const line of heading.series) groups.set(line.name, [...(groups.get(line.name) || []), line]);
    for (const [name, panel] of panels) if (!groups.has(name) || panel.lines !== groups.get(name).length) { panel.remove(); panels.delete(name); }
    for (const [name, lines] of groups) {
      if (!panels.has(name)) {
        const styles = lines.map((line) => (lines.length === 1 ? { ...look.flight, label: line.source } : look[line.source]));
        const made = plots.panel(place, lines[0].label, "time [s]", styles, { key: "record", zoomed: load, whole: () => load(first, last) });
        panels.set(name, { ...made, lines: lines.length });
      }
      const columns = lines.map((line) => [Array.from(line.time), plots.column(line.values, line.factor)]);
      const data = columns.length === 1 ? columns[0] : uPlot.join(columns);
      panels.get(name).show(data, from, to, lines.flatMap((line) => line.flagged));
    }
    [...groups.keys()].forEach((name, k) => { // as they were asked for
      if (place.children[k] !== panels.get(name).figure) place.insertBefore(panels.get(name).figure, place.children[k]);
    });
  }

  async function load(start, end) {
    const [low, high] = [Math.max(first, Math.min(start, end)), Math.min(last, Math.max(start, end))];
    if (!(high > low)) return;
    const turn = ++asked;
    [from, to] = [low, high];
    fields.from.value = low.toFixed(3);
    fields.to.value = high.toFixed(3);
    const names = [...document.querySelectorAll("#choice input:checked")].map((box) => box.value).join(",");
    const width = Math.min(place.clientWidth, 620) * (window.devicePixelRatio || 1);
    const points = Math.min(4000, Math.max(500, 2 * Math.round(width)));
    const query = new URLSearchParams({ names, from: low, to: high, points, format: "binary" });
    const begun = performance.now();
    const response = await fetch(`/api/flights/${root.dataset.flight}/channels?${query}`);
    if (turn !== asked) return;
    if (!response.ok) { said.textContent = await plots.complaint(response); return; }
    const heading = unpacked(await response.arrayBuffer());
    if (turn !== asked) return;
    draw(heading);
    const samples = heading.series.reduce((sum, line) => sum + line.samples, 0);
    said.textContent = `${low.toFixed(2)} to ${high.toFixed(2)} s, ${panels.size} panels, ${samples} samples drawn.`;
    root.dataset.shown = `${low},${high}`;
    root.dataset.took = Math.round(performance.now() - begun);
  }

  const moves = {
    in: (span) => [from + span / 4, to - span / 4],
    out: (span) => [from - span / 2, to + span / 2],
    left: (span) => [Math.max(first, from - span / 2), Math.max(first, from - span / 2) + span],
    right: (span) => [Math.min(last, to + span / 2) - span, Math.min(last, to + span / 2)],
    all: () => [first, last],
  };
  for (const button of root.querySelectorAll("[data-move]")) {
    button.addEventListener("click", () => load(...moves[button.dataset.move](to - from)));
  }
  document.getElementById("window").addEventListener("submit", (event) => {
    event.preventDefault();
    const [low, high] = [Number(fields.from.value), Number(fields.to.value)];
    if (Number.isFinite(low) && Number.isFinite(high) && low < high) load(low, high);
    else said.textContent = "Enter two times in seconds, the earlier one first.";
  });
  document.getElementById("choice").addEventListener("submit", (event) => { event.preventDefault(); load(from, to); });
  load(first, last);
})();
