// The empty state: nothing is open yet, and what can be.

// Outlines around the point of reflection: how bright (filled) and how polarised (dashed) a paint is seen from where.
function outline(views, radii, attributes) {
  const at = views.map((view, i) => [80 + 72 * radii[i] * Math.sin(view * Math.PI / 180), 80 - 72 * radii[i] * Math.cos(view * Math.PI / 180)]);
  return drawn("path", { d: `M80 80L${at.map(p => p.map(x => x.toFixed(1)).join(" ")).join("L")}Z`, ...attributes });
}
function preview(theta_i, views, { intensity, dolp }) {
  const turn = theta_i * Math.PI / 180, [x, y] = [80 - 76 * Math.sin(turn), 80 - 76 * Math.cos(turn)];
  return [
    drawn("path", { d: "M8 80A72 72 0 0 1 152 80", class: "rim" }),
    drawn("path", { d: "M2 80H158", class: "ground" }),
    outline(views, intensity, { class: "bright" }),
    outline(views, dolp, { class: "polarised" }),
    drawn("path", { d: `M${x.toFixed(1)} ${y.toFixed(1)}L80 80`, class: "ray" }),
  ];
}

function emptyState(app, files) {
  const pictures = app.catalogue.paints.map(() => drawn("svg", { viewBox: "0 0 160 84", class: "preview", "aria-hidden": "true" }));
  const card = (paint, i) => element("button", { type: "button", class: "paint", onclick: () => addLayer(app, paint) }, pictures[i],
    element("span", { class: "title" }, paint.name.replaceAll("-", " ")),
    element("span", { class: "kind" }, app.catalogue.models[paint.model].parameters.slice(0, 2).map(p => `${p.symbol}\u00a0=\u00a0${written(paint.parameters[p.name])}`).join(", ")));
  const choices = [["", "choose …"], ...Object.entries(app.catalogue.models).map(([name, m]) => [name, name, m.about])];
  const model = selectAndDo("or a model with its default parameters", [["", choices]], "Begin", value => addLayer(app, defaultLayer(app, value)));
  app.on("answer:previews", ({ theta_i, views, outlines }) => outlines.forEach((o, i) => pictures[i].replaceChildren(...preview(theta_i, views, o))));
  app.send({ type: "previews" });
  return element("section", { class: "empty", "aria-label": "Begin" },
    element("h1", {}, "See how a coating polarises light"),
    element("p", { class: "about" }, "Move a model's parameters and watch its reflection follow: intensity, polarisation, every Mueller element."),
    element("div", { class: "drop" },
      element("p", {}, "Drop a file anywhere on this page: a model, measured data, or a saved state."),
      element("button", { type: "button", class: "first", onclick: files.choose }, icon("open"), "Open a file …")),
    element("h2", {}, "Or begin with a paint"),
    element("p", { class: "about" }, "How bright each is seen in the plane of incidence (filled, logarithmic) and how polarised (dashed); light comes from the left."),
    element("div", { class: "paints" }, app.catalogue.paints.map(card)),
    model.node);
}
