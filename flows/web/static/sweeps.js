// Curves of versions along one input, as the server evaluates them: all six coefficients, with two standard errors.
"use strict";
const sweeps = (() => {
  // The sweep of a version; over, from and to, and the point in SI as the commands take them.
  async function along(version, over, from, to, points, at) {
    const query = new URLSearchParams({ over, from, to, points, at });
    const response = await fetch(`${location.origin}/api/versions/${version}/sweep?${query}`);
    if (!response.ok) throw new Error(await plots.complaint(response));
    return response.json();
  }

  const none = { colour: "transparent", width: 0 };
  const edge = (found, side) => found.value.map((value, k) => (
    value == null || found.standard_error[k] == null ? null : value + side * 2 * found.standard_error[k]));

  // Draws into `place` the versions in `drawn`: [{sweep, label, colour, band, dash, width}]; the last is on top. Panels that
  // are there are used again.
  function draw(place, panels, drawn, factor) {
    const [first] = drawn;
    const x = first.sweep.values.map((value) => value * factor);
    const made = {};
    for (const axis of Object.keys(first.sweep.axes)) {
      const data = [x], styles = [], bands = [];
      for (const { sweep, label, colour, band, dash, width } of drawn) {
        const found = sweep.axes[axis];
        if (band) {
          bands.push({ series: [data.length, data.length + 1], fill: band });
          data.push(edge(found, 1), edge(found, -1));
          styles.push(none, none);
        }
        data.push(found.value);
        styles.push({ colour, width, dash, label });
      }
      const key = `${first.sweep.label} ${drawn.length}`;
      const old = panels[axis];
      if (old && old.key !== key) old.panel.remove();
      made[axis] = old && old.key === key
        ? old : { key, panel: plots.panel(place, `${axis} [-]`, first.sweep.label, styles, { key: "curves", bands }) };
      made[axis].panel.show(data, x[0], x[x.length - 1]);
    }
    return made;
  }
  return { along, draw };
})();
