// A version along one of its inputs, beside its parent: all six coefficients with two standard errors.
"use strict";
(() => {
  const form = document.getElementById("sweep");
  if (!form) return;
  const field = (name) => document.getElementById(name);
  const said = field("swept"), place = field("curves");
  let panels = [], asked = 0;

  function ends() {
    const chosen = field("over").selectedOptions[0];
    field("low").value = plots.shown(Number(chosen.dataset.low)).replace("−", "-");
    field("high").value = plots.shown(Number(chosen.dataset.high)).replace("−", "-");
  }

  async function sweep(version, factor) {
    const query = new URLSearchParams({
      over: field("over").value, from: Number(field("low").value) / factor, to: Number(field("high").value) / factor,
      points: 201, at: field("through").value,
    });
    const response = await fetch(`/api/versions/${version}/sweep?${query}`);
    if (!response.ok) throw new Error(await plots.complaint(response));
    return response.json();
  }

  function draw(own, parent, factor) {
    panels.forEach((panel) => panel.remove());
    panels = [];
    const x = own.values.map((value) => value * factor);
    const none = { colour: "transparent", width: 0 };
    for (const [axis, found] of Object.entries(own.axes)) {
      const spread = found.value.map((value, k) => (found.standard_error[k] == null ? null : 2 * found.standard_error[k]));
      const edge = (side) => found.value.map((value, k) => (value == null || spread[k] == null ? null : value + side * spread[k]));
      const styles = [none, none, { colour: plots.colour("updated"), width: 1.5, label: form.dataset.label }];
      const data = [x, edge(1), edge(-1), found.value];
      if (parent && parent.axes[axis]) {
        styles.push({ colour: plots.colour("database"), width: 1.25, dash: [6, 3], label: form.dataset.parentLabel });
        data.push(parent.axes[axis].value);
      }
      const bands = [{ series: [1, 2], fill: plots.colour("updated-band") }];
      const panel = plots.panel(place, `${axis} [-]`, own.label, styles, { key: "curves", bands });
      panel.show(data, x[0], x[x.length - 1]);
      panels.push(panel);
    }
  }

  async function load() {
    const turn = ++asked, factor = Number(field("over").selectedOptions[0].dataset.factor);
    try {
      const own = await sweep(form.dataset.version, factor);
      const parent = form.dataset.parent ? await sweep(form.dataset.parent, factor).catch(() => null) : null;
      if (turn !== asked) return;
      draw(own, parent, factor);
      const taken = own.taken_as_zero.join(", ");
      said.textContent = `${own.values.length} points.` + (taken ? ` Taken as zero: ${taken}.` : "");
      form.dataset.shown = own.over;
    } catch (error) {
      if (turn === asked) said.textContent = String(error.message || error);
    }
  }

  field("over").addEventListener("change", ends);
  form.addEventListener("submit", (event) => { event.preventDefault(); load(); });
  ends();
  load();
})();
