// What the flights of a list have covered is read from their records, after the list is there.
"use strict";
(async () => {
  const rows = [...document.querySelectorAll("#flights tr[data-flight]")];
  if (!rows.length) return;
  const query = new URLSearchParams(rows.map((row) => ["flight", row.dataset.flight]));
  const response = await fetch(`${location.origin}/api/envelopes?${query}`);
  if (!response.ok) return;
  const found = await response.json();
  const degrees = 180 / Math.PI, digits = { V: 1, alpha: 1, beta: 1, altitude: 0 };
  for (const row of rows) {
    for (const cell of row.querySelectorAll("[data-channel]")) {
      const name = cell.dataset.channel, range = (found[row.dataset.flight] || {})[name];
      const factor = name === "alpha" || name === "beta" ? degrees : 1;
      cell.textContent = range ? range.map((end) => (factor * end).toFixed(digits[name]).replace("-", "−")).join(" … ") : "–";
    }
  }
  document.getElementById("flights").dataset.filled = "yes";
})();
