// The parameters and options of the active model.

// What layers began with, to go back to: paints are known, others began with what they had when they came. A layer that
// is renamed keeps its beginning.
class Beginnings {
  constructor(paints) {
    this.of = new Map(paints.map(paint => [this.key(paint), paint.parameters]));
    this.keys = [];
  }
  key(layer) { return `${layer.model} ${layer.name}`; }
  update(layers) {
    const keys = layers.map(this.key);
    keys.forEach((key, i) => {
      const renamed = keys.length === this.keys.length && this.keys[i].startsWith(`${layers[i].model} `);
      if (!this.of.has(key)) this.of.set(key, renamed ? this.of.get(this.keys[i]) : { ...layers[i].parameters });
    });
    this.keys = keys;
  }
}

PANELS.push({
  name: "parameters",
  title: "Parameters",
  build(place, app) {
    const beginnings = new Beginnings(app.catalogue.paints);
    const begunOf = layer => beginnings.of.get(beginnings.key(layer));
    const about = element("p", { class: "about" }), sliders = element("div", {}), choices = element("div", { class: "options" });
    const reset = element("button", { type: "button", onclick: () => app.change(state => {
      const layer = state.layers[state.active];
      layer.parameters = { ...begunOf(layer) };
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
        rows.set(p.name, sliderRow(p, set, () => begunOf(app.state.layers[app.state.active])[p.name]));
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
        beginnings.update(state.layers);
        const begun = begunOf(layer);
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
