// The empty state: nothing is open yet, and what can be.

function emptyState(app, files) {
  const card = paint => element("button", { type: "button", class: "paint", onclick: () => addLayer(app, paint) },
    element("span", { class: "title" }, paint.name.replaceAll("-", " ")),
    element("span", { class: "kind" }, app.catalogue.models[paint.model].parameters.slice(0, 2).map(p => `${p.symbol} = ${written(paint.parameters[p.name])}`).join(", ")));
  const model = selectField("or a model with its default parameters", [["", [["", "choose …"], ...Object.entries(app.catalogue.models).map(([name, m]) => [name, name, m.about])]]],
    value => { if (value) addLayer(app, defaultLayer(app, value)); model.select.value = ""; });
  return element("section", { class: "empty", "aria-label": "Begin" },
    element("h1", {}, "See how a coating polarises light"),
    element("p", { class: "about" }, "Move a model's parameters and watch its reflection follow: intensity, polarisation, every Mueller element."),
    element("div", { class: "drop" },
      element("p", {}, "Drop a file anywhere on this page: a model, measured data, or a saved state."),
      element("button", { type: "button", class: "first", onclick: files.choose }, icon("open"), "Open a file …")),
    element("h2", {}, "Or begin with a paint"),
    element("div", { class: "paints" }, app.catalogue.paints.map(card)),
    model.node);
}
