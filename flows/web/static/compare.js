// Two versions along one input, while all other inputs are moved by sliders; the address keeps what is shown.
"use strict";
(() => {
  const form = document.getElementById("compare");
  if (!form) return;
  const field = (name) => document.getElementById(name);
  const said = field("swept"), place = field("curves");
  const inputs = [...document.querySelectorAll(".sliders [data-name]")].map((box) => ({
    name: box.dataset.name, box, factor: Number(box.dataset.factor), low: Number(box.dataset.low), high: Number(box.dataset.high),
    slider: box.querySelector("[type=range]"), exact: box.querySelector(".exact"),
  }));
  const named = Object.fromEntries(inputs.map((input) => [input.name, input]));
  const plain = (value) => plots.shown(Number(value)).replace("−", "-");
  let panels = {}, latest = null, busy = false, waiting = false;

  function ends() {
    const chosen = named[field("over").value];
    field("low").value = plain(chosen.low);
    field("high").value = plain(chosen.high);
    hold();
  }

  function hold() { inputs.forEach((input) => { input.box.hidden = input.name === field("over").value; }); }

  // A value beyond the range of its slider widens it.
  function set(input, value) {
    if (!Number.isFinite(value)) return;
    input.slider.min = Math.min(Number(input.slider.min), value);
    input.slider.max = Math.max(Number(input.slider.max), value);
    input.slider.value = value;
    input.exact.value = plain(value);
  }

  function remember() {
    const query = new URLSearchParams(location.search);
    for (const name of ["over", "low", "high"]) query.set(name, field(name).value);
    query.set("at", inputs.map((input) => `${input.name}=${input.exact.value}`).join(","));
    history.replaceState(null, "", `?${query}`);
  }

  function recall() {
    const query = new URLSearchParams(location.search);
    if (named[query.get("over")]) field("over").value = query.get("over");
    ends();
    for (const name of ["low", "high"]) if (query.get(name)) field(name).value = query.get(name);
    document.querySelector(".sliders").closest("details").open = Boolean(query.get("at"));
    for (const pair of (query.get("at") || "").split(",")) {
      const [name, value] = pair.split("=");
      if (named[name] && value !== "") set(named[name], Number(value));
    }
  }

  function point(side) {
    const known = new Set(form.dataset[`${side}Inputs`].split(" "));
    return inputs.filter((input) => known.has(input.name) && input.name !== field("over").value)
      .map((input) => `${input.name}=${Number(input.exact.value) / input.factor}`).join(",");
  }

  async function swept(side, over, factor) {
    if (!form.dataset[`${side}Inputs`].split(" ").includes(over)) return null;
    const [from, to] = [field("low").value, field("high").value].map((value) => Number(value) / factor);
    return sweeps.along(form.dataset[side], over, from, to, 101, point(side));
  }

  const band = (name) => { const own = plots.colour(name); return /^#[0-9a-f]{6}$/i.test(own) ? `${own}33` : "transparent"; };

  function draw() {
    const { before, after, factor } = latest;
    const drawn = [
      { sweep: before, label: form.dataset.beforeLabel, colour: plots.colour("database"), band: band("database"), dash: [6, 3], width: 1.5 },
      { sweep: after, label: form.dataset.afterLabel, colour: plots.colour("updated"), band: band("updated"), width: 1.75, shade: true },
    ].filter(({ sweep }) => sweep);
    panels = sweeps.draw(place, panels, drawn, factor);
    return drawn;
  }

  // One request at a time: what is moved meanwhile is asked for next.
  async function load() {
    if (busy) { waiting = true; return; }
    busy = true;
    const over = field("over").value, factor = named[over].factor;
    try {
      if (!(Number(field("low").value) < Number(field("high").value))) throw new Error("From and To are two numbers, the lower one first.");
      const [before, after] = await Promise.all(["before", "after"].map((side) => swept(side, over, factor)));
      latest = { before, after, factor };
      const drawn = draw();
      said.textContent = (drawn.length < 2 ? `Only ${drawn[0].label} depends on ${over}.` : "") + (after ? sweeps.faded(after, factor) : "");
      form.dataset.shown = `${over} ${point("after")}`;
      remember();
    } catch (error) { said.textContent = String(error.message || error); }
    busy = false;
    if (waiting) { waiting = false; load(); }
  }

  for (const input of inputs) {
    input.exact.value = plain(input.exact.value);
    input.slider.addEventListener("input", () => { input.exact.value = plain(input.slider.value); load(); });
    input.exact.addEventListener("change", () => {
      const value = Number(input.exact.value);
      set(input, Number.isFinite(value) && input.exact.value.trim() ? value : Number(input.slider.value));
      load();
    });
  }
  field("over").addEventListener("change", () => { ends(); load(); });
  for (const name of ["low", "high"]) field(name).addEventListener("change", load);
  form.addEventListener("submit", (event) => { event.preventDefault(); load(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const { panel } of Object.values(panels)) panel.remove();
    panels = {};
    if (latest) draw();
  });
  recall();
  load();
})();
