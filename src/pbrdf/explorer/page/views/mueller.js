// The Mueller matrix: sixteen small hemispheres. A click shows an element large, among the quantities.

VIEWS.push({
  name: "mueller",
  title: "Mueller matrix",
  build(place, app) {
    const tables = app.catalogue.colours;
    const board = new PictureBoard(place, tables);
    board.node.classList.add("matrix");
    const bars = [colourBar(tables), colourBar(tables)], titles = [element("span"), element("span")];
    place.append(element("div", { class: "bars" }, ...bars.map((bar, i) => element("div", {}, titles[i], bar.node))));
    const cells = [];
    const update = () => cells.forEach(cell => cell.node.setAttribute("aria-pressed", String(app.state.quantities.includes(cell.quantity))));
    const toggle = quantity => app.change(state => {
      const chosen = new Set(state.quantities);
      if (!chosen.delete(quantity)) chosen.add(quantity);
      // in the catalogue's order, and never none
      if (chosen.size) state.quantities = app.catalogue.quantities.filter(q => chosen.has(q));
    });
    app.on("state", update);
    return {
      show(header, [buffer]) {
        if (!cells.length) {
          for (const { quantity, symbol } of header.pictures) {
            const canvas = element("canvas", { "aria-hidden": "true" });
            const node = element("button", { type: "button", class: "cell", title: `show ${symbol} large`, onclick: () => toggle(quantity) },
              element("span", { class: "square" }, canvas), element("span", { class: "name" }, symbol));
            cells.push({ quantity, node, canvas });
          }
          board.node.append(...cells.map(cell => cell.node));
          board.canvases = cells.map(cell => cell.canvas);
          update();
        }
        // one range for all but m00, so that their colours compare
        const [whole, ...rest] = header.pictures;
        const widest = Math.max(...rest.flatMap(p => p.extent.map(Math.abs)));
        for (const picture of rest) picture.extent = [-widest, widest];
        board.load(header, buffer);
        bars[0].show(whole, board.range(whole));
        bars[1].show(rest[0], board.range(rest[0]));
        titles[0].textContent = whole.title;
        titles[1].textContent = header.compared ? "Differences of the others over m₀₀" : "The others, over m₀₀";
        board.fit();
        board.paint();
      },
    };
  },
});
