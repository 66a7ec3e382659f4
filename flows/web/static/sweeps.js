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

  // Stretches of x where no flight has been; none on an axis that no increment changes.
  function unflown(x, places) {
    const inside = places.map((place) => place === "inside data");
    if (!inside.includes(true)) return [];
    const stretches = [];
    for (let k = 0; k + 1 < x.length; k++) {
      if (inside[k] && inside[k + 1]) continue;
      const last = stretches[stretches.length - 1];
      if (last && last[1] === x[k]) last[1] = x[k + 1];
      else stretches.push([x[k], x[k + 1]]);
    }
    return stretches;
  }

  // Beyond which values nothing of the changes is left, in words; it looks like a stall.
  function faded({ label, faded_below: below, faded_above: above }, factor) {
    const sides = [["below", below], ["above", above]].filter(([, value]) => value != null);
    const words = sides.map(([side, value]) => `${side} ${plots.shown(value * factor)}`).join(" and ");
    return words && ` Its changes have faded to nothing ${words} (${label}).`;
  }

  // Draws into `place` the versions in `drawn`: [{sweep, label, colour, band, dash, width, shade}]; the last is
  // on top. Shaded: where no flight of the one with `shade` has been. Panels that
  // are there are used again.
  function draw(place, panels, drawn, factor) {
    const [first] = drawn;
    const shaded = drawn.find((each) => each.shade) || first;
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
      made[axis].panel.show(data, x[0], x[x.length - 1], unflown(x, shaded.sweep.axes[axis].place));
    }
    return made;
  }
  return { along, draw, faded };
})();
