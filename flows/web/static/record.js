// A flight's record: the server is asked for as many samples as the screen shows, again for every stretch of time.
// Times on the page count from the first sample. What is shown is in the address: channels, times, and the pair of axes.
"use strict";
(() => {
  const root = document.getElementById("record");
  if (!root) return;
  const zero = Number(root.dataset.start), last = Number(root.dataset.end) - zero;
  const sigmas = new Set(root.dataset.sigmas.split(" "));
  const field = (name) => document.getElementById(name);
  const said = field("said"), place = field("panels"), boxes = [...document.querySelectorAll("#choice input")];
  const known = new Set(boxes.map((box) => box.value));
  const usual = boxes.filter((box) => box.checked).map((box) => box.value);
  const look = () => ({
    measured: { colour: plots.colour("measured"), width: 1.5, label: "measured" },
    reconstructed: { colour: plots.colour("flight"), width: 1, label: "reconstructed" },
    flight: { colour: plots.colour("flight"), width: 1, label: "flight" },
    database: { colour: plots.colour("database"), width: 1.25, dash: [6, 3], label: "database" },
    logged: { colour: plots.colour("flight"), width: 1, label: "logged" },
    sigma: { colour: plots.colour("flight"), width: 1, label: "one standard error" },
  });
  let names = usual, from = 0, to = last, asked = 0, panels = new Map(), shown = null;

  const isLogged = (name) => name.includes(":"); // TOPIC:FIELD; no channel has a colon

  async function get(what, query) {
    // The origin: an address with a name and token in it is refused by fetch.
    const response = await fetch(`${location.origin}/api/flights/${root.dataset.flight}/${what}?${query}`);
    if (!response.ok) throw new Error(await plots.complaint(response));
    return response;
  }

  // uint32 length of the heading, the heading, then float64 time and values of each line.
  function unpacked(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const heading = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let offset = 4 + length;
    const next = (n) => { const part = new Float64Array(buffer, offset, n); offset += 8 * n; return part; };
    for (const line of heading.series) { line.time = next(line.samples).map((t) => t - zero); line.values = next(line.samples); }
    return heading;
  }

  // The standard error at other times: linear between its samples.
  function interpolated(line, times) {
    let k = 0;
    return Array.from(times, (t) => {
      while (k < line.time.length - 2 && line.time[k + 1] < t) k += 1;
      const step = line.time[k + 1] - line.time[k];
      const share = step > 0 ? Math.min(1, Math.max(0, (t - line.time[k]) / step)) : 0;
      return line.values[k] + share * ((line.values[k + 1] ?? line.values[k]) - line.values[k]);
    });
  }

  // Columns and styles of a panel: two standard errors on either side of what was flown, then its lines.
  function panelOf(lines, sigma) {
    const styles = [], columns = [], bands = [];
    const best = lines.filter((line) => line.source !== "database").at(-1);
    if (sigma && best) {
      const spread = interpolated(sigma, best.time);
      const edge = (side) => best.values.map((value, k) => value + 2 * side * spread[k]);
      const none = { colour: "transparent", width: 0 };
      styles.push(none, none);
      for (const side of [1, -1]) columns.push([Array.from(best.time), plots.column(edge(side), best.factor)]);
      bands.push({ series: [1, 2], fill: plots.colour("flight-band") });
    }
    for (const line of lines) {
      const style = lines.length === 1 && line.source === "measured" ? { ...look().flight, label: "measured" } : look()[line.source];
      styles.push(line.version ? { ...style, label: `database ${line.version}` } : style);
      columns.push([Array.from(line.time), plots.column(line.values, line.factor)]);
    }
    return { styles, bands, data: columns.length === 1 ? columns[0] : uPlot.join(columns) };
  }

  function draw() {
    const groups = new Map(names.map((name) => [name, []])), spread = new Map();
    for (const line of shown.series) {
      if (line.source === "sigma") spread.set(line.name, line);
      if (groups.has(line.name)) groups.get(line.name).push(line);
    }
    for (const [name, lines] of groups) {
      const { styles, bands, data } = panelOf(lines, spread.get(`sigma_${name}`));
      const kind = styles.map((style) => style.label).join();
      if (panels.has(name) && panels.get(name).kind !== kind) { panels.get(name).remove(); panels.delete(name); }
      if (!panels.has(name)) {
        const made = plots.panel(place, lines[0].label, "time [s]", styles, { key: "record", bands, zoomed: load, whole: () => load(0, last) });
        panels.set(name, { ...made, kind });
      }
      panels.get(name).show(data, from, to, lines.flatMap((line) => line.flagged).map((stretch) => stretch.map((t) => t - zero)));
    }
    for (const [name, panel] of panels) if (!groups.has(name)) { panel.remove(); panels.delete(name); }
    names.forEach((name, k) => { // as they were asked for
      if (place.children[k] !== panels.get(name).figure) place.insertBefore(panels.get(name).figure, place.children[k]);
    });
  }

  async function load(start, end) {
    const [low, high] = [Math.max(0, Math.min(start, end)), Math.min(last, Math.max(start, end))];
    if (!(high > low)) return;
    const turn = ++asked;
    [from, to] = [low, high];
    field("from").value = low.toFixed(3);
    field("to").value = high.toFixed(3);
    const width = Math.min(place.clientWidth, 620) * (window.devicePixelRatio || 1);
    const points = Math.min(4000, Math.max(500, 2 * Math.round(width)));
    const wanted = [...names, ...names.filter((name) => sigmas.has(name)).map((name) => `sigma_${name}`)];
    const begun = performance.now();
    const period = { from: zero + low, to: zero + high };
    try {
      const query = new URLSearchParams({ names: [...new Set(wanted)].filter((name) => !isLogged(name)).join(","), ...period, points, format: "binary" });
      for (const name of names.filter(isLogged)) query.append("logged", name);
      const response = await get("channels", query);
      const heading = unpacked(await response.arrayBuffer());
      if (turn !== asked) return;
      shown = heading;
      draw();
      const drawn = shown.series.filter((line) => names.includes(line.name)).reduce((sum, line) => sum + line.samples, 0);
      said.textContent = `${low.toFixed(2)} to ${high.toFixed(2)} s, ${panels.size} panels, ${drawn} samples drawn.`;
      root.dataset.shown = `${low},${high}`;
      root.dataset.took = Math.round(performance.now() - begun);
      remember();
      await Promise.all([track(period, turn), pair(period, turn)]);
    } catch (error) {
      if (turn === asked) said.textContent = String(error.message || error);
    }
  }

  async function track(period, turn) {
    if (!field("track")) return;
    const found = await (await get("track", new URLSearchParams({ ...period, points: 2000 }))).json();
    if (turn !== asked) return;
    const time = found.time.map((t) => t - zero);
    const { factor, unit } = field("track").dataset; // of a length
    const shownAs = (values) => values.map((value) => (value == null ? null : value * factor));
    pairs.draw(field("track"), { time, x: shownAs(found.east), y: shownAs(found.north), xLabel: `east [${unit}]`, yLabel: `north [${unit}]`, equal: true });
    let far = 0; // along the track
    const along = found.east.map((east, k) => {
      const step = k ? Math.hypot(east - found.east[k - 1], found.north[k] - found.north[k - 1]) : 0;
      return (far += step || 0);
    });
    field("profile").hidden = !found.altitude.length;
    pairs.draw(field("profile"), { time, x: shownAs(along), y: shownAs(found.altitude), xLabel: `distance flown [${unit}]`, yLabel: `altitude [${unit}]` });
  }

  const brief = (label) => label.slice(0, label.indexOf("]") + 1) || label; // name and unit

  async function pair(period, turn) {
    const [x, y] = [field("x").value, field("y").value];
    const found = await (await get("pairs", new URLSearchParams({ x, y, ...period, points: 4000 }))).json();
    if (turn !== asked) return;
    const [over, under] = [found.x, found.y].map((axis) => axis.values.map((value) => (value == null ? null : value * axis.factor)));
    field("over").querySelector("figcaption").textContent = `${found.y.label} over ${found.x.label}`;
    pairs.draw(field("over"), { time: found.time.map((t) => t - zero), x: over, y: under, xLabel: brief(found.x.label), yLabel: brief(found.y.label) });
    field("over").dataset.shown = `${x},${y}`;
  }

  // Show what the address says, else what is usual.
  function recall() {
    const query = new URLSearchParams(location.search);
    const own = (query.get("show") || "").split(",").filter((name) => known.has(name));
    own.push(...query.getAll("logged").filter(isLogged));
    names = own.length ? own : usual;
    check();
    const axes = { x: names.includes("alpha") ? "alpha" : names[0], y: known.has("CZ") ? "CZ" : names[1] || names[0] };
    for (const axis of ["x", "y"]) field(axis).value = known.has(query.get(axis)) ? query.get(axis) : axes[axis];
    const number = (name, usually) => (query.has(name) && Number.isFinite(Number(query.get(name))) ? Number(query.get(name)) : usually);
    return [number("from", 0), number("to", last)];
  }

  function remember() {
    const query = new URLSearchParams(location.search);
    query.set("show", names.filter((name) => !isLogged(name)).join(","));
    query.delete("logged");
    for (const name of names.filter(isLogged)) query.append("logged", name);
    query.set("from", from.toFixed(3));
    query.set("to", to.toFixed(3));
    for (const axis of ["x", "y"]) query.set(axis, field(axis).value);
    history.replaceState(null, "", `?${String(query).replaceAll("%2C", ",")}`);
  }

  const moves = {
    in: (span) => [from + span / 4, to - span / 4],
    out: (span) => [from - span / 2, to + span / 2],
    left: (span) => [Math.max(0, from - span / 2), Math.max(0, from - span / 2) + span],
    right: (span) => [Math.min(last, to + span / 2) - span, Math.min(last, to + span / 2)],
    all: () => [0, last],
  };
  for (const button of root.querySelectorAll("[data-move]")) {
    button.addEventListener("click", () => load(...moves[button.dataset.move](to - from)));
  }
  function check() {
    for (const box of [...boxes, ...field("fields").querySelectorAll("input")]) box.checked = names.includes(box.value);
  }
  function choose(chosen) {
    names = chosen.length ? chosen : usual;
    check();
    load(from, to);
  }
  for (const button of root.querySelectorAll("[data-show]")) {
    button.addEventListener("click", () => choose(button.dataset.show.split(",")));
  }
  field("choice").addEventListener("submit", (event) => {
    event.preventDefault();
    choose([...boxes.filter((box) => box.checked).map((box) => box.value), ...names.filter(isLogged)]);
  });

  // The fields of every topic, listed when somebody looks for them.
  async function list() {
    if (field("fields").children.length) return;
    const make = (name, parent, text) => { const made = document.createElement(name); made.textContent = text || ""; parent.append(made); return made; };
    try {
      for (const topic of await (await get("topics", "")).json()) {
        const part = make("details", field("fields"));
        const seconds = topic.samples > 1 ? topic.end - topic.start : 0;
        const rate = seconds > 0 ? `, ${plots.shown(Number(((topic.samples - 1) / seconds).toPrecision(3)))} Hz` : "";
        make("summary", part, `${topic.topic} (${topic.samples} samples${rate})`);
        const grid = make("div", part);
        grid.className = "fields";
        for (const { field: word, unit } of topic.fields) {
          const label = make("label", grid), box = make("input", label);
          box.type = "checkbox";
          box.value = `${topic.topic}:${word}`;
          make("span", label, unit ? `${word} [${unit}]` : word);
        }
      }
      check();
    } catch (error) { make("p", field("fields"), String(error.message || error)); }
  }
  field("topics").addEventListener("toggle", list);
  field("fields").addEventListener("change", (event) => {
    const { value, checked } = event.target;
    choose(checked ? [...names, value] : names.filter((name) => name !== value));
  });
  field("find").addEventListener("input", () => {
    const word = field("find").value.trim().toLowerCase();
    for (const part of field("fields").children) {
      const labels = [...part.querySelectorAll("label")];
      for (const label of labels) label.hidden = !label.querySelector("input").value.toLowerCase().includes(word);
      part.hidden = labels.every((label) => label.hidden);
      part.open = word !== "" && !part.hidden;
    }
  });
  field("window").addEventListener("submit", (event) => {
    event.preventDefault();
    const [low, high] = [Number(field("from").value), Number(field("to").value)];
    if (Number.isFinite(low) && Number.isFinite(high) && low < high) load(low, high);
    else said.textContent = "Enter two times in seconds, the earlier one first.";
  });
  field("pair").addEventListener("submit", (event) => { event.preventDefault(); load(from, to); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const panel of panels.values()) panel.remove();
    panels = new Map();
    load(from, to);
  });
  load(...recall());
})();
