// Files that are dropped onto a page, or chosen, and how they are sent.
"use strict";
const drops = (() => {
  // Files chosen in a field or dropped anywhere on the page; `take` gets the list.
  function listen(form, chosen, take) {
    chosen.addEventListener("change", () => { take([...chosen.files]); chosen.value = ""; });
    form.addEventListener("submit", (event) => event.preventDefault());
    const holdsFiles = (event) => [...(event.dataTransfer?.types || [])].includes("Files");
    addEventListener("dragover", (event) => { if (holdsFiles(event)) { event.preventDefault(); form.classList.add("over"); } });
    addEventListener("dragleave", (event) => { if (!event.relatedTarget) form.classList.remove("over"); });
    addEventListener("drop", (event) => {
      if (!holdsFiles(event)) return;
      event.preventDefault();
      form.classList.remove("over");
      take([...event.dataTransfer.files]);
    });
  }

  // Send a file to a path of this console: `say` gets progress, `working` what comes after it; the answer, or an Error in words.
  function send(path, file, csrf, say, working) {
    return new Promise((resolve, reject) => {
      const request = new XMLHttpRequest();
      const refused = (text) => reject(new Error(text));
      request.open("POST", `${location.origin}${path}?name=${encodeURIComponent(file.name)}`);
      request.setRequestHeader("X-CSRF-Token", csrf);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.addEventListener("progress", (event) => {
        if (event.lengthComputable && event.loaded < event.total) say(`${Math.round((100 * event.loaded) / event.total)} % sent`);
      });
      request.upload.addEventListener("load", () => say(working));
      request.addEventListener("error", () => refused("the connection was lost"));
      request.addEventListener("load", () => {
        let answer = null;
        try { answer = JSON.parse(request.responseText); } catch { refused(request.responseText || `refused (${request.status})`); return; }
        if (answer.error) refused([answer.error.what, answer.error.where, answer.error.remedy].filter(Boolean).join("; "));
        else resolve(answer);
      });
      request.send(file);
    });
  }

  return { listen, send };
})();
