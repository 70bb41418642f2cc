// The chosen quantities over the hemisphere of viewing directions.

// Below this radiance, in 1/sr, planes hold no values (evaluation.py).
const DARK = 2e-20;

// Rings of zenith angles and rays of azimuths over a hemisphere, with the light, its mirror image and a cross to move.
function directionRings() {
  const at = (zenith, azimuth) => [zenith / 90 * Math.cos(azimuth * Math.PI / 180), -zenith / 90 * Math.sin(azimuth * Math.PI / 180)];
  const write = (x, y, text) => drawn("text", { x, y, "dominant-baseline": "central", "text-anchor": "middle" }, text);
  const rings = [30, 60, 90].map(zenith => drawn("circle", { r: zenith / 90 }));
  const rays = [0, 45, 90, 135].map(azimuth => {
    const [x, y] = at(90, azimuth);
    return drawn("line", { x1: x, y1: y, x2: -x, y2: -y });
  });
  const words = [
    ...[0, 90, 180, -90].map(azimuth => write(...at(90 * (azimuth % 180 ? 1.06 : 1.08), azimuth), `${azimuth}°`.replace("-", "−"))),
    ...[30, 60].map(zenith => write(...at(zenith, 67.5), `${zenith}°`)),
  ];
  // a wide dark stroke under a narrow light one is seen on every colour
  const mark = (d, ...more) => drawn("g", {}, ...["under", "over"].map(layer => drawn("path", { class: layer, d })), ...more);
  const beams = [0, 1, 2, 3, 4, 5, 6, 7].map(k => [Math.cos(k * Math.PI / 4), Math.sin(k * Math.PI / 4)].map(x => x.toFixed(3)));
  const sun = mark(`M.028 0A.028 .028 0 1 1-.028 0 .028 .028 0 1 1 .028 0${beams.map(([x, y]) => `M${0.042 * x} ${0.042 * y}L${0.064 * x} ${0.064 * y}`).join("")}`);
  const mirror = mark("M0-.045L.045 0 0 .045-.045 0z");
  const cross = mark("M-.08 0H-.02M.02 0H.08M0-.08V-.02M0 .02V.08");
  cross.setAttribute("visibility", "hidden");
  const size = 2 * HEMISPHERE_REACH;
  return {
    node: drawn("svg", { viewBox: `${-size / 2} ${-size / 2} ${size} ${size}`, "aria-hidden": "true" },
      drawn("g", { class: "rings" }, ...rings, ...rays), ...words, sun, mirror, cross),
    light(theta) {
      sun.setAttribute("transform", `translate(${at(theta, 180).join()})`);
      mirror.setAttribute("transform", `translate(${at(theta, 0).join()})`);
    },
    cross(direction) {
      cross.setAttribute("visibility", direction ? "visible" : "hidden");
      if (direction) cross.setAttribute("transform", `translate(${at(...direction).join()})`);
    },
  };
}

// Pictures over hemispheres, painted again with every answer and where the page changes its layout. `canvases` are
// theirs, in order, in squares of one size.
class PictureBoard {
  constructor(place, tables) {
    this.node = element("div", { class: "board" });
    place.append(this.node);
    this.painter = new HemispherePainter(tables);
    this.pictures = [];
    this.canvases = [];
    this.ranges = new Map();
    new ResizeObserver(() => { if (this.fit()) this.paint(); }).observe(this.node);
  }

  // Make the canvases as large as they are shown; whether that has changed them.
  fit() {
    if (!this.canvases.length) return false;
    const size = Math.max(Math.round(this.canvases[0].getBoundingClientRect().width * devicePixelRatio), 1);
    const other = this.canvases.filter(canvas => canvas.width !== size || canvas.height !== size);
    other.forEach(canvas => Object.assign(canvas, { width: size, height: size }));
    // letters of 11 pixels at least, in the units of the pictures
    this.node.style.setProperty("--letter", `${Math.max(0.062, 11 * devicePixelRatio * 2 * HEMISPHERE_REACH / size)}px`);
    return other.length > 0;
  }

  load(header, buffer) {
    this.painter.load(buffer, header.grid);
    const before = this.ranges, key = p => `${p.quantity} ${p.colours}`;
    this.pictures = header.pictures;
    this.ranges = new Map(header.pictures.map(p => [key(p), colourRange(p, before.get(key(p)), header.dragging)]));
    this.range = p => this.ranges.get(key(p));
  }

  paint() { this.pictures.forEach((picture, i) => this.painter.paint(this.canvases[i], picture, this.range(picture))); }
}

VIEWS.push({
  name: "hemisphere",
  title: "Hemisphere",
  wide: true,
  build(place, app) {
    const tables = app.catalogue.colours;
    const board = new PictureBoard(place, tables);
    const readout = element("output", { class: "readout", "aria-live": "polite" });
    const hint = "Point at a picture, or move the cross with the arrow keys, to read values.";
    place.append(readout, element("p", { class: "about" }, "Sun: where the light comes from. Diamond: its mirror direction."));
    Object.assign(board.node, { tabIndex: 0 });
    board.node.setAttribute("role", "group");
    board.node.setAttribute("aria-label", "Pictures over the hemisphere of viewing directions; the arrow keys move a cross whose values are read out, Shift in steps of ten degrees, Escape takes it away");
    let figures = [], kept = null, pointed = null, header = null;

    const value = picture => {
      const x = board.painter.value(picture, ...(pointed ?? kept));
      if (x === null) return `${picture.title.split(",")[0]} none`;
      return `${picture.title.split(",")[0]} ${written(x)}${picture.colours === "cyclic" ? "°" : picture.logarithmic ? " /sr" : ""}`;
    };
    const read = () => {
      const direction = pointed ?? kept;
      figures.forEach(figure => figure.rings.cross(direction));
      const dark = direction && board.pictures.some(p => p.logarithmic && board.painter.value(p, ...direction) < DARK);
      const text = !direction ? hint : [`θ ${written(direction[0])}°, φ ${written(direction[1])}°`, ...dark ? ["no light"] : board.pictures.map(value)].join(" · ");
      if (readout.textContent !== text) readout.textContent = text;
    };
    // Direction at a point of a picture, from its middle in radii; none outside of the hemisphere.
    const directionAt = (x, y) => {
      const zenith = 90 * Math.hypot(x, y);
      return zenith > 90 ? null : [zenith, Math.atan2(y, x) * 180 / Math.PI];
    };
    const point = event => {
      const box = event.currentTarget.getBoundingClientRect();
      const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map(s => (2 * s - 1) * HEMISPHERE_REACH);
      return directionAt(x, -y);
    };
    board.node.addEventListener("keydown", event => {
      if (event.target !== board.node || event.ctrlKey || event.metaKey || event.altKey) return;
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!step && event.key !== "Escape") return;
      event.preventDefault();
      pointed = null;
      if (step) {
        const [zenith, azimuth] = kept ?? [0, 0], far = (event.shiftKey ? 10 : 1) / 90;
        const x = zenith / 90 * Math.cos(azimuth * Math.PI / 180) + far * step[0], y = zenith / 90 * Math.sin(azimuth * Math.PI / 180) + far * step[1];
        kept = directionAt(x, y) ?? kept;
      } else kept = null;
      read();
    });

    const setRange = (quantity, ends) => app.change(state => {
      const settings = state.settings.hemisphere ??= {};
      settings.range ??= {};
      if (ends) settings.range[quantity] = ends; else delete settings.range[quantity];
    });
    const build = () => {
      figures.forEach(figure => figure.node.remove());
      figures = header.pictures.map(picture => {
        const rings = directionRings(), canvas = element("canvas", { "aria-hidden": "true" });
        const square = element("div", {
          class: "square", role: "img",
          onpointermove: event => { pointed = point(event); read(); },
          onpointerleave: () => { pointed = null; read(); },
          onclick: event => { kept = point(event); read(); },
        }, canvas, rings.node);
        const bar = colourBar(tables), title = element("span");
        const fix = element("button", { type: "button", class: "fix", title: "Fix the range of these colours", onclick: () => figure.toggle() }, "fix range");
        const ends = ["least", "largest"].map(which => element("input", {
          type: "number", step: "any", "aria-label": `${which} value of the colours`, onchange: () => figure.set(),
        }));
        bar.ends.forEach((end, i) => end.after(ends[i]));
        const figure = {
          rings, canvas,
          node: element("figure", {}, element("figcaption", {}, title, fix), square, bar.node),
          shown: () => board.range(figure.picture).map(v => Number((figure.picture.logarithmic ? 10 ** v : v).toPrecision(3))),
          toggle() { setRange(figure.picture.quantity, figure.picture.range ? null : figure.shown()); },
          set() { setRange(figure.picture.quantity, ends.map(input => input.valueAsNumber)); },
          update(picture) {
            figure.picture = picture;
            const range = board.range(picture);
            bar.show(picture, range);
            if (title.textContent !== picture.title) title.textContent = picture.title;
            fix.hidden = picture.colours === "cyclic";
            ends.forEach((input, i) => { input.hidden = !picture.range; bar.ends[i].hidden = !input.hidden; });
            fix.setAttribute("aria-pressed", String(Boolean(picture.range)));
            if (picture.range && !ends.includes(document.activeElement)) figure.shown().forEach((v, i) => { ends[i].value = v; });
            rings.light(header.theta_i);
          },
          name() {
            const [low, high] = figure.shown();
            const whose = header.compared ? `${header.name} less ${header.compared}` : header.name;
            square.setAttribute("aria-label", `${figure.picture.title} of ${whose} over the hemisphere, colours from ${low} to ${high}`);
          },
        };
        return figure;
      });
      board.node.append(...figures.map(figure => figure.node));
      board.canvases = figures.map(figure => figure.canvas);
    };
    read();
    // who measures, or pictures the page, listens to this
    app.on("drawn", () => board.node.dispatchEvent(new CustomEvent("pbrdf-drawn", { bubbles: true })));
    return {
      show(given, [buffer]) {
        const same = header && header.pictures.map(p => p.quantity).join() === given.pictures.map(p => p.quantity).join();
        header = given;
        board.load(header, buffer);
        if (!same) build();
        header.pictures.forEach((picture, i) => figures[i].update(picture));
        if (!same) board.fit();
        board.paint();
        // values that run along with a slider are for the eyes alone
        readout.setAttribute("aria-live", header.dragging ? "off" : "polite");
        read();
        if (!header.dragging) figures.forEach(figure => figure.name());
      },
    };
  },
});
