// What is drawn over the directions, and of which part of the models.

const QUANTITY_TEXTS = {
  intensity: ["I", "intensity"], dolp: ["DoLP", "degree of linear polarisation"], aolp: ["AoLP", "angle of linear polarisation"],
  q: ["Q/I", "Q over I"], u: ["U/I", "U over I"], v: ["V/I", "V over I"],
};
const PART_TEXTS = { total: "all light", specular: "of the facets", diffuse: "of the body" };

PANELS.push({
  name: "quantities",
  title: "Quantities",
  build(place, app) {
    const buttons = new Map();
    const toggle = (name, text, title) => {
      const button = element("button", { type: "button", class: "chip", title, "aria-label": title, "aria-pressed": "false", onclick: () => app.change(state => {
        const chosen = new Set(state.quantities);
        if (!chosen.delete(name)) chosen.add(name);
        // in the catalogue's order, and never none
        if (chosen.size) state.quantities = app.catalogue.quantities.filter(q => chosen.has(q));
      }) }, text);
      buttons.set(name, button);
      return button;
    };
    const elements = app.catalogue.quantities.filter(q => !(q in QUANTITY_TEXTS));
    const more = element("details", { class: "elements" }, element("summary", {}, "Mueller elements"),
      element("div", { class: "matrix", role: "group", "aria-label": "Mueller elements" }, elements.map(q => toggle(q, q, `Mueller element ${q}`))));
    const part = choiceRow("Part of the models", app.catalogue.parts.map(p => ({ value: p, text: PART_TEXTS[p] ?? p, title: p })), value => app.change(state => { state.part = value; }));
    part.node.dataset.place = "part";
    place.append(
      element("div", { class: "chips", role: "group", "aria-label": "Quantities of the reflected light", "data-place": "quantities" },
        Object.entries(QUANTITY_TEXTS).map(([name, [text, title]]) => toggle(name, text, title))),
      more, part.node);
    return {
      update(state) {
        for (const [name, button] of buttons) button.setAttribute("aria-pressed", state.quantities.includes(name));
        if (state.quantities.some(q => elements.includes(q))) more.open = true;
        part.show(state.part);
      },
    };
  },
});
