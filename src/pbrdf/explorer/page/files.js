// Files that the reader drops or chooses: saved states and models; everything else is the data panel's.

// A state or a model is a few kilobytes.
const MOST_JSON = 1 << 20;

function openFiles(app, el) {
  const input = element("input", { type: "file", multiple: true, class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: async () => {
    await take([...input.files]);
    input.value = "";
  } });
  el.append(input);

  async function take(files) {
    for (const file of files) {
      const content = file.name.toLowerCase().endsWith(".json") && file.size <= MOST_JSON ? await jsonOf(file) : null;
      if (content?.layers) app.send({ type: "read_state", state: content, from: file.name });
      else if (content?.model && content?.parameters) app.send({ type: "read_state", from: file.name, model: { ...content, name: file.name.replace(/\.json$/i, "") } });
      else if (app.listeners.has("file")) app.tell("file", file);
      else app.tell("note", `${file.name}: this is neither a model nor a saved state.`);
    }
  }

  // Files are taken wherever on the explorer they fall.
  const holds = event => event.dataTransfer?.types.includes("Files");
  el.addEventListener("dragover", event => { if (holds(event)) { event.preventDefault(); el.classList.add("dropping"); } });
  el.addEventListener("dragleave", event => { if (!el.contains(event.relatedTarget)) el.classList.remove("dropping"); });
  el.addEventListener("drop", event => {
    el.classList.remove("dropping");
    if (!holds(event)) return;
    event.preventDefault();
    take([...event.dataTransfer.files]);
  });
  return { choose: () => input.click(), take };
}

async function jsonOf(file) {
  try { return JSON.parse(await file.text()); } catch { return null; }
}
