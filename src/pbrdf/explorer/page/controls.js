// Sliders of the parameters.

PANELS.push({
  name: "parameters",
  title: "Parameters",
  build(place, app) {
    const rows = new Map();
    let shown = "";
    const rebuild = layer => {
      place.replaceChildren();
      rows.clear();
      for (const p of app.catalogue.models[layer.model].parameters) {
        const id = freshId(p.name);
        const set = dragging => event => app.change(state => {
          state.layers[state.active].parameters[p.name] = Number(event.target.value);
        }, { dragging });
        const slider = element("input", { type: "range", id, min: p.lower, max: p.upper, step: "any", name: p.name, oninput: set(true), onchange: set(false) });
        const number = element("output", { for: id });
        place.append(element("label", { for: id, title: p.about }, p.symbol), slider, number);
        rows.set(p.name, { slider, number });
      }
    };
    return {
      update(state) {
        const layer = state.layers[state.active];
        if (shown !== layer.model) { rebuild(layer); shown = layer.model; }
        for (const [name, { slider, number }] of rows) {
          slider.value = layer.parameters[name];
          number.value = written(layer.parameters[name]);
        }
      },
    };
  },
});
