// Files that the reader drops or chooses: saved states, and what pbrdf opens, models, data, fits and maps.

// Bytes of a state, at most.
const MOST_STATE = 1 << 20;

function openFiles(app, el) {
  const asker = askerOf(app, el);
  let mostBytes = Infinity;
  app.on("answer:welcome", content => { mostBytes = content.most_bytes; });
  const input = element("input", { type: "file", multiple: true, class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: async () => {
    await take([...input.files]);
    input.value = "";
  } });
  el.append(input);

  async function take(files) {
    for (const file of files) {
      const state = await stateIn(file);
      if (state) app.send({ type: "read_state", state, from: file.name });
      else if (file.size > mostBytes) app.tell("note", `${file.name}: ${Math.round(file.size / 1e6)} MB are more than the page takes; open it with pbrdf explore ${file.name}`);
      else await asker.send(file);
    }
  }
  app.on("answer:opened", ({ name, layers, datasets, beginning, maps }) => {
    const begins = !app.state;
    app.tell("note", `${name} is open.`);
    for (const layer of layers) addLayer(app, layer);
    // data want a model beside them
    if (!app.state && datasets.length + maps.length) addLayer(app, defaultLayer(app, Object.keys(app.catalogue.models)[0]));
    if (datasets.length) showData(app, datasets[0], beginning);
    if (maps.length) showMap(app, maps[0], begins && !datasets.length ? ["cuts"] : FIRST_VIEWS);
  });

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
  return { choose: () => input.click(), take, close: asker.close };
}

// Data that were opened here begin as those that the program was started with: the light at a measured angle, what was
// measured, along a line of theirs.
function showData(app, set, { theta_i, quantities }) {
  app.change(state => {
    const { settings } = state;
    settings.data = { set };
    state.light.theta_i = theta_i;
    state.quantities = quantities.length ? quantities : [...app.catalogue.blank.quantities];
    if (settings.cuts) for (const name of ["along", "cut"]) delete settings.cuts[name];
  });
}

// The state that a file holds, null where it holds something else.
async function stateIn(file) {
  if (!file.name.toLowerCase().endsWith(".json") || file.size > MOST_STATE) return null;
  try {
    const content = JSON.parse(await file.text());
    return content && Array.isArray(content.layers) ? content : null;
  } catch { return null; }
}
