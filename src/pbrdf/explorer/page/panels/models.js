// The models that are shown together: which are seen, which one the sliders move.

// As many as the server takes.
const MOST_LAYERS = 6;

// A layer whose parameters are the model's defaults.
function defaultLayer(app, model) {
  const { parameters, options } = app.catalogue.models[model];
  return {
    name: model, model, shown: true,
    parameters: Object.fromEntries(parameters.map(p => [p.name, p.default])),
    options: Object.fromEntries(Object.entries(options).map(([name, option]) => [name, option.choices[0]])),
  };
}

// A state that shows one layer, everything else as by default.
const stateOfLayer = (app, layer) => ({ ...structuredClone(app.catalogue.blank), layers: [structuredClone(layer)] });

// A name that no other layer has.
function freshName(name, layers) {
  const taken = new Set(layers.map(layer => layer.name));
  const stem = name.replace(/ \d+$/, "");
  let fresh = name;
  for (let i = 2; taken.has(fresh); i++) fresh = `${stem} ${i}`;
  return fresh;
}

// Add a layer and have the sliders move it.
function addLayer(app, layer) {
  if (!app.state) { app.replace(stateOfLayer(app, layer)); return; }
  if (app.state.layers.length >= MOST_LAYERS) { app.tell("note", `${MOST_LAYERS} models are shown at most: remove one first.`); return; }
  app.change(state => {
    state.layers.push({ ...structuredClone(layer), name: freshName(layer.name, state.layers) });
    state.active = state.layers.length - 1;
  });
}

PANELS.push({
  name: "models",
  title: "Models",
  build(place, app) {
    const list = element("ul", { class: "layers" }), group = freshId("active");
    const { models, paints, looks } = app.catalogue;
    const adding = selectAndDo("Another model", [
      ["", [["", "a paint or a model …"]]],
      ["Paints", paints.map((paint, i) => [`paint:${i}`, paint.name])],
      ["Models with their default parameters", Object.entries(models).map(([name, model]) => [`model:${name}`, name, model.about])],
    ], "Add", value => {
      const [kind, which] = [value.slice(0, 5), value.slice(6)];
      addLayer(app, kind === "paint" ? paints[which] : defaultLayer(app, which));
    });
    const comparing = selectField("Difference to", [["", [["", "none"]]]], value => app.change(state => {
      state.compare = value === "" ? null : Number(value);
    }));
    comparing.node.dataset.place = "compare";
    place.append(list, adding.node, comparing.node);
    let rows = [], built = "";

    const row = index => {
      const edit = change => app.change(state => change(state, state.layers[index]));
      const active = element("input", { type: "radio", name: group, onchange: () => edit(state => { state.active = index; }) });
      const name = element("input", {
        type: "text", class: "name", maxlength: 80, spellcheck: "false", "aria-label": "name of the model",
        onchange: () => edit((state, layer) => { layer.name = name.value.trim() || layer.model; }),
        onkeydown: event => { if (event.key === "Enter") name.blur(); },
      });
      const shown = iconButton("shown", "Hide", () => edit((state, layer) => { layer.shown = !layer.shown; }));
      const copy = iconButton("copy", "Duplicate", () => addLayer(app, app.state.layers[index]));
      const remove = iconButton("remove", "Remove", () => {
        edit(state => {
          state.layers.splice(index, 1);
          const moved = i => i > index ? i - 1 : i;
          state.active = Math.min(moved(state.active), state.layers.length - 1);
          state.compare = state.compare === null || state.compare === index ? null : moved(state.compare);
        });
        list.querySelector("input[type=radio]:checked")?.focus();
      });
      const kind = element("span", { class: "kind" });
      const node = element("li", { "data-place": `layers.${index}` },
        element("label", { class: "pick" }, active, swatch(looks[index]), element("span", { class: "unseen" })),
        element("div", { class: "named" }, name, kind), shown, copy, remove);
      return { node, active, name, shown, copy, remove, kind, said: node.querySelector(".pick .unseen") };
    };

    return {
      update(state) {
        if (rows.length !== state.layers.length) {
          rows = state.layers.map((_, i) => row(i));
          list.replaceChildren(...rows.map(r => r.node));
        }
        rows.forEach((r, i) => {
          const layer = state.layers[i];
          r.active.checked = i === state.active;
          r.node.classList.toggle("active", i === state.active);
          r.node.classList.toggle("off", !layer.shown);
          if (r.name.value !== layer.name) r.name.value = layer.name;
          r.said.textContent = `edit ${layer.name}`;
          r.kind.textContent = layer.model;
          r.kind.title = models[layer.model].about;
          relabel(r.shown, layer.shown ? "shown" : "hidden", `${layer.shown ? "Hide" : "Show"} ${layer.name}`);
          relabel(r.copy, "copy", `Duplicate ${layer.name}`);
          relabel(r.remove, "remove", `Remove ${layer.name}`);
          r.remove.disabled = state.layers.length === 1;
          r.copy.disabled = state.layers.length >= MOST_LAYERS;
        });
        adding.select.disabled = state.layers.length >= MOST_LAYERS;
        const names = state.layers.map((layer, i) => [String(i), layer.name]).filter((_, i) => i !== state.active);
        if (built !== JSON.stringify(names)) {
          built = JSON.stringify(names);
          comparing.select.replaceChildren(element("option", { value: "" }, "none"), ...names.map(([value, text]) => element("option", { value }, text)));
        }
        comparing.select.disabled = !names.length;
        comparing.select.value = state.compare === null || state.compare === state.active ? "" : String(state.compare);
      },
    };
  },
});
