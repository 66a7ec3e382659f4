// Logs that are dropped onto the list of flights, or chosen: sent one after the other, and what became of each.
"use strict";
(() => {
  const form = document.getElementById("upload");
  if (!form) return;
  const owner = document.getElementById("owner"), chosen = document.getElementById("logs"), list = document.getElementById("sent");
  const waiting = [];
  let busy = false;

  function ending(entry, answer) {
    const ended = answer.kind === "stored" ? `${answer.verdict || "stored"}` : answer.kind;
    entry.textContent = `${entry.dataset.name}: ${ended}${answer.reason ? `: ${answer.reason}` : ""} `;
    if (answer.flight) {
      const link = document.createElement("a");
      link.href = `/flights/${encodeURIComponent(answer.flight)}`;
      link.textContent = "look at the flight";
      entry.append(link);
    }
    entry.dataset.ended = answer.kind;
  }

  async function send({ file, vehicle, entry }) {
    const say = (text) => { entry.textContent = `${entry.dataset.name}: ${text}`; };
    const path = `/api/vehicles/${encodeURIComponent(vehicle)}/logs`;
    try { ending(entry, await drops.send(path, file, form.dataset.csrf, say, "being ingested")); }
    catch (error) { say(error.message); entry.dataset.ended = "refused"; }
  }

  async function work() {
    if (busy) return;
    busy = true;
    while (waiting.length) await send(waiting.shift());
    busy = false;
  }

  function add(files) {
    for (const file of files) {
      const entry = document.createElement("li");
      entry.dataset.name = file.name;
      entry.textContent = `${file.name}: waiting`;
      list.append(entry);
      waiting.push({ file, vehicle: owner.value, entry });
    }
    work();
  }

  drops.listen(form, chosen, add);
})();
