// The parameters and options of the active model.

// What a layer began with: a paint's parameters, or the model's defaults.
function beginningOf(app, layer) {
  const paint = app.catalogue.paints.find(p => p.name === layer.name && p.model === layer.model);
  return paint?.parameters ?? Object.fromEntries(app.catalogue.models[layer.model].parameters.map(p => [p.name, p.default]));
}

PANELS.push({
  name: "parameters",
  title: "Parameters",
  build(place, app) {
    const about = element("p", { class: "about" }), sliders = element("div", {}), choices = element("div", { class: "options" });
    const reset = element("button", { type: "button", onclick: () => app.change(state => {
      const layer = state.layers[state.active];
      layer.parameters = { ...beginningOf(app, layer) };
    }) }, "Reset all");
    place.append(about, sliders, choices, element("div", { class: "buttons" }, reset));
    const rows = new Map(), selects = new Map();
    let shown = "";
    const rebuild = layer => {
      const { parameters, options, about: text } = app.catalogue.models[layer.model];
      about.textContent = text;
      rows.clear();
      selects.clear();
      for (const p of parameters) {
        const set = (value, dragging) => app.change(state => { state.layers[state.active].parameters[p.name] = value; }, { dragging });
        rows.set(p.name, sliderRow(p, set, () => beginningOf(app, app.state.layers[app.state.active])[p.name]));
      }
      // the explorer draws fast while a slider moves and as by default at rest, whatever a model's accuracy is
      for (const [name, option] of Object.entries(options)) if (name !== "accuracy") {
        selects.set(name, selectField(name, [["", option.choices.map(c => [c, c])]], value => app.change(state => {
          state.layers[state.active].options[name] = value;
        }), { title: option.about }));
      }
      sliders.replaceChildren(...[...rows.values()].map(row => row.node));
      choices.replaceChildren(...[...selects.values()].map(field => field.node));
    };
    return {
      update(state) {
        const layer = state.layers[state.active], path = `layers.${state.active}`;
        if (shown !== layer.model) { rebuild(layer); shown = layer.model; }
        const begun = beginningOf(app, layer);
        let moved = false;
        for (const [name, row] of rows) {
          row.node.dataset.place = `${path}.parameters.${name}`;
          row.show(layer.parameters[name] ?? begun[name]);
          moved ||= layer.parameters[name] !== begun[name];
        }
        for (const [name, { node, select }] of selects) {
          node.dataset.place = `${path}.options.${name}`;
          select.value = layer.options?.[name] ?? select.options[0].value;
        }
        reset.disabled = !moved;
      },
    };
  },
});
