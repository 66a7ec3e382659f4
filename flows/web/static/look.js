// A log that is dropped onto the page, or chosen: sent, and its page opened.
"use strict";
(() => {
  const form = document.getElementById("look"), chosen = document.getElementById("log"), said = document.getElementById("said");
  let busy = false;

  async function look(file) {
    if (busy || !file) return;
    busy = true;
    const say = (text) => { said.textContent = `${file.name}: ${text}`; };
    try {
      const answer = await drops.send(`/api/${form.elements.what.value}/logs`, file, form.dataset.csrf, say, "being read");
      say("its page is open");
      location.assign(`${location.origin}${answer.page}`);
    } catch (error) { say(error.message); }
    busy = false;
  }

  drops.listen(form, chosen, (files) => look(files[0]));
})();
