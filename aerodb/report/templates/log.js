"use strict";
// The values of all panels at the time under the cursor; arrow keys move it too.
(() => {
  const data = JSON.parse(document.getElementById("samples").textContent);
  const plots = [...document.querySelectorAll("[data-panel]")];
  const [start, end] = data.limits;
  const shown = (value) => (value === null ? "–" : String(value).replace("-", "−"));
  let at = start;

  // The sample nearest to a time; times increase.
  function nearest(time, wanted) {
    let low = 0, high = time.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] <= wanted) low = middle; else high = middle;
    }
    return wanted - time[low] < time[high] - wanted ? low : high;
  }

  function show(time) {
    at = Math.min(end, Math.max(start, time));
    const place = data.left + (data.right - data.left) * (at - start) / (end - start);
    plots.forEach((plot) => {
      const mark = plot.querySelector(".mark");
      mark.style.left = `${100 * place}%`;
      mark.hidden = false;
      const lines = data.panels[plot.dataset.panel].filter((line) => line.time.length);
      const values = lines.map((line) => {
        const k = nearest(line.time, at);
        return `${line.label} ${shown(line.values[k])}${line.unit && line.unit !== "-" ? ` ${line.unit}` : ""}`;
      });
      plot.querySelector("output").textContent = `${at.toFixed(2)} ${data.unit}: ${values.join(", ")}`;
    });
  }

  for (const plot of plots) {
    const picture = plot.querySelector("img");
    plot.tabIndex = 0;
    plot.addEventListener("pointermove", (event) => {
      const box = picture.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - data.left) / (data.right - data.left);
      if (share >= -0.02 && share <= 1.02) show(start + share * (end - start));
    });
    plot.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      show(at + step * (end - start) / (event.shiftKey ? 20 : 200));
    });
  }
})();
