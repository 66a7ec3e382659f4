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

  function send({ file, vehicle, entry }) {
    return new Promise((resolve) => {
      const request = new XMLHttpRequest();
      const say = (text) => { entry.textContent = `${entry.dataset.name}: ${text}`; };
      const refused = (text) => { say(text); entry.dataset.ended = "refused"; resolve(); };
      request.open("POST", `${location.origin}/api/vehicles/${encodeURIComponent(vehicle)}/logs?name=${encodeURIComponent(file.name)}`);
      request.setRequestHeader("X-CSRF-Token", form.dataset.csrf);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.addEventListener("progress", (event) => {
        if (event.lengthComputable) say(event.loaded < event.total ? `${Math.round((100 * event.loaded) / event.total)} % sent` : "being ingested");
      });
      request.upload.addEventListener("load", () => say("being ingested"));
      request.addEventListener("error", () => refused("the connection was lost"));
      request.addEventListener("load", () => {
        let answer = null;
        try { answer = JSON.parse(request.responseText); } catch { refused(request.responseText || `refused (${request.status})`); return; }
        if (answer.error) { refused([answer.error.what, answer.error.where, answer.error.remedy].filter(Boolean).join("; ")); return; }
        ending(entry, answer);
        resolve();
      });
      request.send(file);
    });
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

  chosen.addEventListener("change", () => { add([...chosen.files]); chosen.value = ""; });
  form.addEventListener("submit", (event) => event.preventDefault());
  const holdsFiles = (event) => [...(event.dataTransfer?.types || [])].includes("Files");
  addEventListener("dragover", (event) => { if (holdsFiles(event)) { event.preventDefault(); form.classList.add("over"); } });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) form.classList.remove("over"); });
  addEventListener("drop", (event) => {
    if (!holdsFiles(event)) return;
    event.preventDefault();
    form.classList.remove("over");
    add([...event.dataTransfer.files]);
  });
})();
