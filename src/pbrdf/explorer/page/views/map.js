// A map of parameters or of materials: its picture, the chosen pixel, and the way from there to models and curves.

// Rows and columns that are shown at least, of a picture that is zoomed into.
const LEAST_REGION = 8;
// Time after the last key or turn of the wheel that makes one step of undo of them all, ms.
const MAP_SETTLED = 500;

// Put a map on the stage, beside the views that are there, or others if the page has not said which.
function showMap(app, name, others) {
  app.change(state => {
    const page = state.settings.page ??= {};
    page.views ??= [...others];
    if (!page.views.includes("map")) page.views.push("map");
    state.settings.map = { name };
  });
}

VIEWS.push({
  name: "map",
  title: "Map",
  build(place, app) {
    const table = decoded(app.catalogue.colours.sequential);
    const settings = () => app.state?.settings.map ?? {};
    let timer = 0;
    const set = (edit, going = false) => {
      app.change(state => edit(state.settings.map ??= {}), { dragging: going, views: ["map"] });
      clearTimeout(timer);
      if (going) timer = setTimeout(() => app.change(() => {}, { views: [] }), MAP_SETTLED);
    };
    app.signal.addEventListener("abort", () => clearTimeout(timer));

    const nothing = element("p", { class: "about", hidden: true }, "No map is open. Drop one on the page (map.nc), or start with: pbrdf explore MAP.zarr");
    const choices = element("div", { class: "choose" });
    const canvas = element("canvas", { "aria-hidden": "true" });
    const frame = element("div", { class: "pixels", tabindex: 0, role: "group" }, canvas);
    const readout = element("p", { class: "read" }, "\u00a0");
    const legend = new ColourLegend();
    const kinds = element("ul", { class: "kinds" });
    const zoomIn = iconButton("add", "Zoom in (+)", () => zoom(0.5)), zoomOut = iconButton("less", "Zoom out (−)", () => zoom(2)), whole = element("button", { type: "button", onclick: () => fit() }, "Whole map");
    const again = element("button", { type: "button", hidden: true, onclick: () => { held = null; app.draw(false, ["map"]); } }, "Read again");
    const note = element("p", { class: "about" });
    const where = element("p", { class: "where" }), status = element("p", {});
    const numbers = element("table", {}), facts = element("dl", {});
    const addModel = element("button", { type: "button", onclick: () => ask({ model: true }) }, "Show this pixel’s model and data");
    const addData = element("button", { type: "button", onclick: () => ask({ model: false }) }, "Its data alone");
    const noData = element("p", { class: "about" });
    const pixel = element("div", { class: "pixel" },
      element("div", { role: "status" }, where, status), numbers, facts, element("div", { class: "buttons" }, addModel, addData), noData);
    const body = element("div", { class: "map", hidden: true }, choices,
      element("div", { class: "sides" },
        element("div", { class: "picture" }, frame, readout, legend.node, kinds, element("div", { class: "buttons" }, zoomIn, zoomOut, whole, again), note),
        pixel));
    place.append(nothing, body);

    // what is chosen, the picture that the page has, and the one that it has asked for
    let header = null, held = null, asked = null, wanted = null, listed = "", pointed = null;

    const ask = what => { wanted = what; app.send({ type: "map_pixel", state: app.state }); };
    app.on("answer:map_pixel", ({ layer, data, said }) => {
      const model = wanted?.model ? layer : null;
      const known = model ? app.state.layers.findIndex(l => l.name === model.name && l.model === model.model && JSON.stringify(l.parameters) === JSON.stringify(model.parameters)) : -1;
      if (said.length) app.tell("note", said.join(" "));
      if (model && known < 0 && app.state.layers.length >= MOST_LAYERS) { app.tell("note", `${MOST_LAYERS} models are shown at most: remove one first.`); return; }
      if (!model && !data) return;
      app.change(state => {
        if (known >= 0) state.active = known;
        else if (model) {
          state.layers.push({ ...model, name: freshName(model.name, state.layers) });
          state.active = state.layers.length - 1;
        }
        if (!data) return;
        state.settings.data = { set: data.set };
        state.light.theta_i = data.theta_i;
        const views = state.settings.page?.views;
        if (Array.isArray(views) && !views.includes("cuts")) views.push("cuts");
      });
    });

    // Pictures: asked for where the page has another, one at a time.
    const askPicture = () => {
      if (asked || !header?.key || held?.header.key === header.key) return;
      asked = header.key;
      app.send({ type: "map_picture", state: app.state });
    };
    app.on("answer:map_picture", (content, [values, given]) => {
      asked = null;
      const [numbers, words] = [values, given].map(view => view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
      held = { header: content, values: new Float32Array(numbers), kinds: new Uint16Array(words), image: null };
      if (content.key !== header?.key) { askPicture(); return; }
      describePicture();
      redraw();
    });
    app.on("answer:error", content => {
      if (content.about !== "map_picture") return;
      asked = null;
      note.textContent = content.text;
    });
    app.on("disconnected", () => { asked = null; });

    // The picture, a pixel of the image for each of its own.
    function image() {
      const { header: { rows, columns, range, logarithmic, kinds: told }, values, kinds: numbers } = held;
      const colours = told.map(({ colour }) => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16)));
      const scale = logarithmic ? Math.log10 : x => x;
      const [low, high] = (range ?? [0, 1]).map(scale);
      const pixels = new ImageData(columns, rows);
      for (let i = 0; i < values.length; i++) {
        const kind = numbers[i];
        if (kind) pixels.data.set(colours[kind - 1], 4 * i);
        else {
          const at = 4 * Math.round(255 * Math.min(Math.max((scale(values[i]) - low) / (high - low), 0), 1));
          for (let c = 0; c < 3; c++) pixels.data[4 * i + c] = table[at + c];
        }
        pixels.data[4 * i + 3] = 255;
      }
      const made = element("canvas", { width: columns, height: rows });
      made.getContext("2d").putImageData(pixels, 0, 0);
      return made;
    }
    function redraw() {
      if (!held || !header?.key) return;
      held.image ??= image();
      const { region: [top, left, rows, columns], step } = held.header;
      const context = canvas.getContext("2d");
      context.imageSmoothingEnabled = false;
      context.clearRect(0, 0, canvas.width, canvas.height);
      const across = canvas.width / columns, down = canvas.height / rows;
      context.drawImage(held.image, 0, 0, held.image.width * step * across, held.image.height * step * down);
      if (!header.pixel) return;
      const [row, column] = header.pixel.at;
      const x = Math.floor((column - left) / step) * step * across, y = Math.floor((row - top) / step) * step * down;
      // a dark ring around a light one is seen on every colour; single pixels of a large map are too small for it
      const [wide, high] = [across, down].map(size => Math.max(step * size, 9 * devicePixelRatio));
      for (const [colour, width] of [["#000", 4], ["#fff", 2]]) {
        context.strokeStyle = colour;
        context.lineWidth = width * devicePixelRatio;
        context.strokeRect(x + (step * across - wide) / 2, y + (step * down - high) / 2, wide, high);
      }
    }
    keepSharp(canvas, redraw);

    function describePicture() {
      const { range, title, unit, kinds: told, logarithmic, step } = held.header;
      legend.node.hidden = !range;
      if (range) legend.show(table, range, unit, logarithmic ? `${title}, logarithmic` : title);
      kinds.replaceChildren(...told.map(kind => {
        const sample = element("span", { class: "sample", "aria-hidden": "true" });
        sample.style.background = kind.colour;
        return element("li", {}, sample, `${kind.text} (${kind.share})`);
      }));
      note.textContent = [
        range ? "The colours hold the middle 98 % of the pixels that are shown." : "",
        step > 1 ? `One pixel of every ${step} by ${step} is shown: zoom in to see all.` : "",
        header.left ? `${header.left} parts of the map are not fitted yet.` : "",
      ].filter(Boolean).join(" ");
    }

    // Regions: first row, first column, rows, columns. A turn of the wheel goes on from the last one, whose answer may be
    // on its way.
    const region = () => settings().region ?? [0, 0, ...header.size];
    const clamped = ([top, left, rows, columns]) => {
      const [h, w] = header.size;
      return [Math.round(Math.min(Math.max(top, 0), h - rows)), Math.round(Math.min(Math.max(left, 0), w - columns)), rows, columns];
    };
    const show = (next, going) => set(s => {
      if (next[2] >= header.size[0] && next[3] >= header.size[1]) delete s.region; else s.region = next;
    }, going);
    function zoom(factor, at = null, going = false) {
      if (!header?.key) return;
      const [top, left, rows, columns] = region(), [h, w] = header.size;
      const [row, column] = at ?? header.pixel?.at ?? [top + rows / 2, left + columns / 2];
      const next = [rows, columns].map((n, i) => Math.min(Math.max(Math.round(n * factor), Math.min(LEAST_REGION, [h, w][i])), [h, w][i]));
      show(clamped([row - (row - top) * next[0] / rows, column - (column - left) * next[1] / columns, ...next]), going);
    }
    const fit = () => { if (header?.key) show([0, 0, ...header.size]); };

    function choose(row, column, going = false) {
      const [h, w] = header.size, [top, left, rows, columns] = region();
      row = Math.min(Math.max(row, 0), h - 1);
      column = Math.min(Math.max(column, 0), w - 1);
      set(s => {
        s.pixel = [row, column];
        if (row < top || row >= top + rows || column < left || column >= left + columns) {
          s.region = clamped([row - rows / 2, column - columns / 2, rows, columns]);
        }
      }, going);
    }

    // Row and column under the pointer, of the picture that is painted.
    const pixelAt = event => {
      const box = canvas.getBoundingClientRect(), { region: [top, left, rows, columns], step } = (held ?? { header }).header;
      const row = Math.floor((event.clientY - box.top) / box.height * rows / step) * step, column = Math.floor((event.clientX - box.left) / box.width * columns / step) * step;
      return row < 0 || column < 0 || row >= rows || column >= columns ? null : [top + row, left + column];
    };
    const read = () => {
      const at = pointed, picture = held?.header;
      let text = "Click a pixel or use the arrow keys; + and − zoom, so does the wheel after a click.";
      if (at && picture?.key === header.key) {
        const i = Math.floor((at[0] - picture.region[0]) / picture.step) * picture.columns + Math.floor((at[1] - picture.region[1]) / picture.step);
        const kind = held.kinds[i], names = header.dims.length > 1 ? header.dims : [null, ...header.dims];
        const place = names.map((name, k) => name === null ? null : `${name} ${at[k]}`).filter(Boolean).join(", ");
        text = `${place}: ${kind ? picture.kinds[kind - 1].text : `${written(held.values[i], 4)} ${picture.unit}`.trim()}`;
      }
      if (readout.textContent !== text) readout.textContent = text;
    };
    let grip = null;
    frame.addEventListener("pointerdown", event => {
      if (event.button || !header?.key) return;
      frame.setPointerCapture(event.pointerId);
      grip = { x: event.clientX, y: event.clientY, region: region(), moved: false };
    });
    frame.addEventListener("pointermove", event => {
      if (!header?.key) return;
      pointed = pixelAt(event);
      read();
      if (!grip) return;
      // a click that trembles moves nothing
      grip.moved ||= Math.hypot(event.clientX - grip.x, event.clientY - grip.y) > 4;
      const [top, left, rows, columns] = grip.region;
      if (!grip.moved || (rows === header.size[0] && columns === header.size[1])) return;
      const box = canvas.getBoundingClientRect();
      show(clamped([top - (event.clientY - grip.y) / box.height * rows, left - (event.clientX - grip.x) / box.width * columns, rows, columns]), true);
    });
    frame.addEventListener("pointerup", event => {
      const at = grip && !grip.moved ? pixelAt(event) : null;
      grip = null;
      if (at) choose(...at);
    });
    frame.addEventListener("pointercancel", () => { grip = null; });
    frame.addEventListener("pointerleave", () => { pointed = null; read(); });
    // the page scrolls where the picture has not been chosen, or cannot go on
    frame.addEventListener("wheel", event => {
      const [, , rows, columns] = header?.region ?? [], out = event.deltaY > 0;
      if (!header?.key || !(event.ctrlKey || frame.getRootNode().activeElement === frame)) return;
      if (out && rows === header.size[0] && columns === header.size[1]) return;
      event.preventDefault();
      zoom(out ? 1.25 : 0.8, pixelAt(event), true);
    }, { passive: false });
    frame.addEventListener("keydown", event => {
      if (!header?.key || event.ctrlKey || event.metaKey || event.altKey) return;
      const move = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      const act = { "+": () => zoom(0.5), "-": () => zoom(2), "0": fit, Escape: () => set(s => { delete s.pixel; }) }[event.key];
      if (!move && !act) return;
      event.preventDefault();
      if (act) { act(); return; }
      const [top, left, rows, columns] = region(), { step } = header;
      const far = step * (event.shiftKey ? 10 : 1);
      // a key goes on from the last one, whose answer may be on its way
      const from = settings().pixel ?? [top + step * Math.floor(rows / step / 2) - move[0] * far, left + step * Math.floor(columns / step / 2) - move[1] * far];
      choose(from[0] + far * move[0], from[1] + far * move[1], true);
    });

    const list = () => {
      const { maps, name, variables, place: others } = header;
      const key = JSON.stringify([maps, name, variables, others.map(([dim, , size]) => [dim, size])]);
      if (key !== listed) {
        listed = key;
        const groups = [...new Set(variables.map(([, group]) => group))].map(group => [group, variables.filter(v => v[1] === group).map(([value, , text]) => [value, text])]);
        const which = selectField("Map", [["", maps.map(map => [map, map])]], value => set(s => { Object.keys(s).forEach(k => delete s[k]); s.name = value; }));
        const what = selectField("Shown", groups, value => set(s => { s.variable = value; }));
        which.node.hidden = maps.length < 2;
        const places = others.map(([dim, , size]) => {
          const id = freshId("place");
          const input = element("input", { type: "number", id, class: "number", min: 0, max: size - 1, step: 1, name: dim, onchange: () => set(s => { (s.place ??= {})[dim] = Number(input.value); }) });
          return { input, node: element("div", { class: "field short" }, element("label", { for: id }, `${dim}, 0 … ${size - 1}`), input) };
        });
        choices.replaceChildren(which.node, what.node, ...places.map(p => p.node));
        list.update = () => {
          which.select.value = header.name;
          what.select.value = header.variable;
          header.place.forEach(([, index], i) => { places[i].input.value = index; });
        };
      }
      list.update();
    };
    const describePixel = () => {
      const told = header.pixel;
      for (const node of [numbers, facts, addModel.parentNode]) node.hidden = !told;
      where.textContent = told ? told.where : "No pixel is chosen.";
      status.textContent = told ? told.status : "";
      noData.textContent = told ? header.no_data : "";
      if (!told) return;
      addModel.hidden = !header.has_models;
      addModel.textContent = header.no_data ? "Show this pixel’s model" : "Show this pixel’s model and data";
      addData.hidden = Boolean(header.no_data);
      numbers.hidden = !told.rows.length;
      numbers.replaceChildren(
        element("thead", {}, element("tr", {}, ["parameter", "value ± standard error", "limits"].map(text => element("th", { scope: "col" }, text)))),
        element("tbody", {}, told.rows.map(row => element("tr", {}, element("th", { scope: "row", title: row.about }, row.text), element("td", {}, `${row.written} ${row.unit}`.trim()), element("td", {}, row.note || "–")))));
      facts.replaceChildren(...told.facts.flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)]));
    };

    return {
      show(given) {
        if (given.error) return;
        header = given;
        nothing.hidden = header.maps.length > 0;
        body.hidden = !nothing.hidden;
        if (!header.key) return;
        const [, , rows, columns] = header.region, [h, w] = header.size;
        // one row of pixels would be too flat to be pointed at
        const ratio = Math.min(Math.max(columns / rows, 0.25), 8);
        frame.style.aspectRatio = String(ratio);
        frame.style.maxWidth = `calc(64vh * ${ratio})`;
        const shape = header.dims.length > 1 ? `${h} rows (${header.dims[0]}, from the top) by ${w} columns (${header.dims[1]}, from the left)` : `${w} pixels (${header.dims[0]}, from the left)`;
        frame.setAttribute("aria-label", `Picture of ${header.name}, ${shape}; the arrow keys choose a pixel, Shift ten at once, plus and minus zoom, 0 shows all, Escape gives the pixel up`);
        zoomOut.disabled = whole.disabled = rows === h && columns === w;
        zoomIn.disabled = rows <= Math.min(LEAST_REGION, h) && columns <= Math.min(LEAST_REGION, w);
        again.hidden = !header.left;
        list();
        describePixel();
        if (held?.header.key === header.key) describePicture();
        askPicture();
        redraw();
        read();
      },
    };
  },
});
