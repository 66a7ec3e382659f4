// A version along one of its inputs, beside its parent: all six coefficients with two standard errors.
"use strict";
(() => {
  const form = document.getElementById("sweep");
  if (!form) return;
  const field = (name) => document.getElementById(name);
  const said = field("swept"), place = field("curves");
  let panels = {}, latest = null, asked = 0;

  function ends() {
    const chosen = field("over").selectedOptions[0];
    field("low").value = plots.shown(Number(chosen.dataset.low)).replace("−", "-");
    field("high").value = plots.shown(Number(chosen.dataset.high)).replace("−", "-");
  }

  const sweep = (version, factor) => sweeps.along(
    version, field("over").value, Number(field("low").value) / factor, Number(field("high").value) / factor, 201, field("through").value);

  function draw() {
    const { own, parent, factor } = latest;
    const drawn = [{ sweep: own, label: form.dataset.label, colour: plots.colour("updated"), band: plots.colour("updated-band"), width: 1.5, shade: true }];
    if (parent) drawn.push({ sweep: parent, label: form.dataset.parentLabel, colour: plots.colour("database"), dash: [6, 3], width: 1.25 });
    panels = sweeps.draw(place, panels, drawn, factor);
  }

  async function load() {
    const turn = ++asked, factor = Number(field("over").selectedOptions[0].dataset.factor);
    try {
      const own = await sweep(form.dataset.version, factor);
      const parent = form.dataset.parent ? await sweep(form.dataset.parent, factor).catch(() => null) : null;
      if (turn !== asked) return;
      latest = { own, parent, factor };
      draw();
      const taken = own.taken_as_zero.join(", ");
      said.textContent = `${own.values.length} points.` + (taken ? ` Taken as zero: ${taken}.` : "") + sweeps.faded(own, factor);
      form.dataset.shown = own.over;
    } catch (error) {
      if (turn === asked) said.textContent = String(error.message || error);
    }
  }

  field("over").addEventListener("change", ends);
  form.addEventListener("submit", (event) => { event.preventDefault(); load(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const { panel } of Object.values(panels)) panel.remove();
    panels = {};
    if (latest) draw();
  });
  ends();
  load();
})();
