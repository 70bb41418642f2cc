// What views have in common beside fields: a bar of the colours with its ends in words, and canvases as sharp as the
// screen.

class ColourLegend {
  constructor() {
    this.bar = element("canvas", { width: 256, height: 1, "aria-hidden": "true" });
    this.least = element("span", {});
    this.about = element("span", {});
    this.most = element("span", {});
    this.node = element("div", { class: "colour-legend" }, this.bar,
      element("div", {}, this.least, this.about, this.most));
  }

  // `table` has 256 colours of four bytes, `ends` are the numbers at both ends.
  show(table, ends, unit, about) {
    const colours = new ImageData(new Uint8ClampedArray(table), 256, 1);
    if (this.table !== table) this.bar.getContext("2d").putImageData(colours, 0, 0);
    this.table = table;
    [this.least.textContent, this.most.textContent] = ends.map(end => `${written(end)} ${unit}`.trim());
    this.about.textContent = about;
  }
}

// Give a canvas as many pixels as the screen has there, and draw again whenever that changes.
function keepSharp(canvas, redraw, most = 1600) {
  new ResizeObserver(() => {
    const ratio = window.devicePixelRatio || 1, scale = Math.min(ratio, most / Math.max(canvas.clientWidth, 1));
    const width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (!width || !height || (canvas.width === width && canvas.height === height)) return;
    canvas.width = width;
    canvas.height = height;
    redraw();
  }).observe(canvas);
}
