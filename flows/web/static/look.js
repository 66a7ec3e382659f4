// A log that is dropped onto the page, or chosen: sent, and its page opened.
"use strict";
(() => {
  const form = document.getElementById("look"), chosen = document.getElementById("log"), said = document.getElementById("said");
  let busy = false;

  function look(file) {
    if (busy || !file) return;
    busy = true;
    const request = new XMLHttpRequest();
    const say = (text) => { said.textContent = `${file.name}: ${text}`; };
    const ended = (text) => { say(text); busy = false; };
    request.open("POST", `${location.origin}/api/looked-at/logs?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("X-CSRF-Token", form.dataset.csrf);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.addEventListener("progress", (event) => {
      if (event.lengthComputable && event.loaded < event.total) say(`${Math.round((100 * event.loaded) / event.total)} % sent`);
    });
    request.upload.addEventListener("load", () => say("being read"));
    request.addEventListener("error", () => ended("the connection was lost"));
    request.addEventListener("load", () => {
      let answer = null;
      try { answer = JSON.parse(request.responseText); } catch { ended(request.responseText || `refused (${request.status})`); return; }
      if (answer.error) { ended([answer.error.what, answer.error.where, answer.error.remedy].filter(Boolean).join("; ")); return; }
      ended("its page is open");
      location.assign(`${location.origin}${answer.page}`);
    });
    request.send(file);
  }

  chosen.addEventListener("change", () => { look(chosen.files[0]); chosen.value = ""; });
  form.addEventListener("submit", (event) => event.preventDefault());
  const holdsFiles = (event) => [...(event.dataTransfer?.types || [])].includes("Files");
  addEventListener("dragover", (event) => { if (holdsFiles(event)) { event.preventDefault(); form.classList.add("over"); } });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) form.classList.remove("over"); });
  addEventListener("drop", (event) => {
    if (!holdsFiles(event)) return;
    event.preventDefault();
    form.classList.remove("over");
    look(event.dataTransfer.files[0]);
  });
})();
