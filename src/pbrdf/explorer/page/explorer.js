// The module: builds the page in an element and talks to an AnyWidget model.

function render({ model, el }) {
  const app = new Application(model);
  el.classList.add("pbrdf-explorer");
  const message = element("p", { role: "status" });
  el.append(message);
  app.on("answer:error", content => { message.textContent = content.text; });
  app.on("disconnected", () => { message.textContent = "The program behind this page has ended; start it again with pbrdf explore."; });
  app.on("answer:welcome", content => {
    app.catalogue = content.catalogue;
    const side = element("aside", { "aria-label": "Controls" }), stage = element("section", { "aria-label": "Views" });
    el.append(side, stage);
    const panels = PANELS.map(panel => {
      const place = element("fieldset", {}, element("legend", {}, panel.title)), inside = element("div", {});
      place.append(inside);
      side.append(place);
      return panel.build(inside, app);
    });
    const built = new Map(VIEWS.map(view => {
      const place = element("article", { "aria-label": view.title });
      stage.append(place);
      return [view.name, view.build(place, app)];
    }));
    app.shownViews = () => [...built.keys()];
    for (const [name, view] of built) app.on(`picture:${name}`, (header, buffers) => view.show(header, buffers));
    app.on("state", () => panels.forEach(panel => panel.update(app.state)));
    app.state = content.state ?? null;
    if (!app.state) return;
    app.tell("state", { dragging: false });
    app.draw();
  });
  app.send({ type: "hello" });
  return () => app.send({ type: "goodbye" });
}

export default { render };
