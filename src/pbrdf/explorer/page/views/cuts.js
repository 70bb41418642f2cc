// Curves along one line of directions, the measured points on it, and how far they are from the active model.

// Units of the drawing are pixels, as long as it is no narrower or wider than this.
const CUT_LEAST = 260, CUT_MOST = 640;
const CUT_LEFT = 58, CUT_RIGHT = 10, CUT_TOP = 26, CUT_BOTTOM = 38;
// Heights of the curves, the deviations and the difference of two models.
const CUT_HEIGHT = 196, CUT_LOW = 74, CUT_GAP = 14;
// Decades below the top that a logarithmic axis reaches, at most.
const CUT_DECADES = 5;
// How near the pointer has to be to a point, in units of the drawing.
const CUT_NEAR = 14;
const CUT_MANY_TICKS = 5;
// Polarisation that is none.
const CUT_NOTHING = 1e-6;

const doubles = view => new Float64Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
const singles = view => new Float32Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));

// A value with its standard uncertainty, two digits of the latter.
function withError(value, std) {
  if (!(std > 0)) return written(value, 4);
  const decimals = 1 - Math.floor(Math.log10(std));
  if (decimals < 0 || decimals > 9) return `${written(value, 4)} ± ${written(std, 2)}`;
  return `${value.toFixed(decimals)} ± ${std.toFixed(decimals)}`.replace("-", "−");
}

// Steps of 1, 2 or 5 times a power of ten between two numbers.
function evenTicks(low, high, count = CUT_MANY_TICKS) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(s => s * power >= rough * 0.999);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) ticks.push(Number((k * step).toPrecision(12)));
  return ticks;
}

// Steps that suit angles in degrees.
function angleTicks(low, high, count) {
  const step = [1, 2, 5, 10, 15, 30, 45, 60, 90].find(s => (high - low) / s <= count) ?? 180;
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9; ++k) ticks.push(k * step);
  return ticks;
}

// Zero, and a number on either side of it.
function sideTicks(high) {
  const power = 10 ** Math.floor(Math.log10(high * 0.85)), side = power * [5, 2, 1].find(s => s * power <= high * 0.85);
  return [-side, 0, side];
}

// An axis from numbers to units of the drawing.
class CutAxis {
  constructor([low, high], from, to, logarithmic = false) {
    Object.assign(this, { low, high, from, to, logarithmic });
    this.map = logarithmic ? Math.log10 : value => value;
    this.start = this.map(low);
    this.scale = (to - from) / (this.map(high) - this.start);
  }
  at(value) { return this.from + (this.map(value) - this.start) * this.scale; }
  back(place) { return this.start + (place - this.from) / this.scale; }
  ticks(count) {
    if (!this.logarithmic && this.low === -this.high && count < 5) return sideTicks(this.high);
    const decades = Math.log10(this.high / this.low);
    if (!this.logarithmic || decades < 0.6) return evenTicks(this.low, this.high, count);
    const ticks = [];
    for (let e = Math.floor(this.start - 1e-9); e <= Math.log10(this.high) + 1e-9; ++e) {
      for (const step of decades < 1.5 ? [1, 2, 5] : [1]) ticks.push(Number((step * 10 ** e).toPrecision(3)));
    }
    return ticks.filter(tick => tick >= this.low * 0.999 && tick <= this.high * 1.001);
  }
}

// What an axis has to hold of these numbers.
function cutRange(values, { logarithmic = false, zero = false, centred = false, least = 0 }) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (!Number.isFinite(value) || (logarithmic && value <= 0)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return logarithmic ? [0.1, 1] : centred ? [-1, 1] : [0, 1];
  if (logarithmic) {
    low = Math.max(low, high / 10 ** CUT_DECADES);
    const few = high / low < 30 ? [1, 2, 5, 10] : [1, 10];
    const below = 10 ** Math.floor(Math.log10(low)), above = 10 ** Math.floor(Math.log10(high));
    low = below * Math.max(...few.filter(s => s * below <= low * 1.0001));
    high = above * Math.min(...few.filter(s => s * above >= high * 0.9999));
    return low < high ? [low, high] : [low / 2, high * 2];
  }
  if (centred) { high = Math.max(-low, high, least) * 1.05; low = -high; }
  if (zero) low = Math.min(low, 0);
  if (high - low < 1e-9 * Math.max(Math.abs(high), 1)) { low -= 0.5; high += 0.5; }
  const step = evenTicks(low, high)[1] - evenTicks(low, high)[0] || high - low;
  const part = step / 2;
  return [Math.floor(low / part + 1e-6) * part, Math.ceil(high / part - 1e-6) * part];
}

// One quantity: curves, below them deviations of the points, and the difference of two models.
class CutPlot {
  constructor() {
    this.ranges = {};
    this.whole = CUT_LEAST;
    this.node = drawn("svg", { class: "cut", "aria-hidden": "true" });
  }

  // While something is dragged, an axis only grows.
  range(name, wanted, dragging) {
    const before = this.ranges[name];
    const kept = dragging && before && (before[0] > 0) === (wanted[0] > 0);
    return this.ranges[name] = kept ? [Math.min(before[0], wanted[0]), Math.max(before[1], wanted[1])] : wanted;
  }

  panel(top, height, axis, label, inside) {
    const width = this.whole - CUT_LEFT - CUT_RIGHT;
    const grid = drawn("g", { class: "grid" }), words = drawn("g", { class: "words" });
    for (const tick of axis.ticks(height > 100 ? 5 : 3)) {
      const y = top + axis.at(tick);
      grid.append(drawn("line", { x1: CUT_LEFT, x2: CUT_LEFT + width, y1: y, y2: y, class: tick === 0 ? "zero" : "" }));
      words.append(drawn("text", { x: CUT_LEFT - 6, y: y + 4, "text-anchor": "end" }, written(tick, 4)));
    }
    for (const tick of angleTicks(this.x.low, this.x.high, width < 300 ? 5 : 8)) {
      const x = CUT_LEFT + this.x.at(tick);
      grid.append(drawn("line", { x1: x, x2: x, y1: top, y2: top + height }));
    }
    words.append(drawn("text", { x: CUT_LEFT, y: top - 6, class: "label" }, label));
    // an svg of its own ends what is drawn at its edge
    this.node.append(grid, words, drawn("svg", { x: CUT_LEFT, y: top, width, height, viewBox: `0 0 ${width} ${height}` }, ...inside));
  }

  // A line through values; one of angles that are the same after half a turn ends where it leaves their range.
  path(xs, ys, axis, attributes, turning = false) {
    let d = "", pen = "M";
    for (let i = 0; i < xs.length; ++i) {
      const value = ys[i];
      if (!Number.isFinite(value) || (axis.logarithmic && value <= 0)) { pen = "M"; continue; }
      if (turning && Math.abs(value - ys[i - 1]) > 90) pen = "M";
      d += `${pen}${this.x.at(xs[i]).toFixed(1)} ${Math.min(Math.max(axis.at(value), -1e4), 1e4).toFixed(1)}`;
      pen = "L";
    }
    return drawn("path", { d, fill: "none", ...attributes });
  }

  draw(cut, k, settings, looks) {
    const { header, x, at, points } = cut;
    const { name, label } = header.quantities[k];
    const size = header.count, count = at.length;
    const column = j => points.subarray((4 * k + j) * count, (4 * k + j + 1) * count);
    const measured = column(0), std = column(1), deviation = column(2), weight = column(3);
    const curves = header.layers.map((_, i) => cut.curves.subarray((i * header.quantities.length + k) * size, (i * header.quantities.length + k + 1) * size));
    const bright = name === "intensity" || name === "m00";
    const logarithmic = bright && settings.logarithmic !== false;
    const used = i => !header.off[i];
    const values = [...curves.flatMap(curve => [...curve]), ...[...measured].filter((_, i) => used(i))];
    const ends = this.range(logarithmic ? "logarithmic" : "linear", cutRange(values, { logarithmic, zero: bright || name === "dolp" }), header.dragging);
    this.whole = Math.min(Math.max(this.node.clientWidth, CUT_LEAST), CUT_MOST);
    const width = this.whole - CUT_LEFT - CUT_RIGHT;
    const edge = (x[x.length - 1] - x[0]) * 0.02;
    this.x = new CutAxis([x[0] - edge, x[x.length - 1] + edge], 0, width);
    this.node.replaceChildren();
    const y = new CutAxis(ends, CUT_HEIGHT, 0, logarithmic);
    const inside = header.layers.map((layer, i) => this.path(x, curves[i], y, {
      stroke: looks[layer % looks.length].colour, "stroke-width": layer === cut.active ? 2.4 : 1.5, "stroke-dasharray": looks[layer % looks.length].dash.join(" "),
    }, name === "aolp"));
    this.marks = [];
    const low = [];
    const heaviest = Math.max(...[...weight].filter(Number.isFinite), 0);
    for (let i = 0; i < count; ++i) {
      const place = this.x.at(at[i]), kind = header.off[i] ? "off" : header.held_out[i] ? "held" : "used";
      if (Number.isFinite(measured[i]) && !(logarithmic && measured[i] <= 0)) {
        const height = y.at(measured[i]);
        if (std[i] > 0 && used(i)) {
          const foot = logarithmic ? Math.max(measured[i] - std[i], y.low / 10) : measured[i] - std[i];
          inside.push(drawn("line", { x1: place, x2: place, y1: y.at(foot), y2: y.at(measured[i] + std[i]), class: "bar" }));
        }
        inside.push(cutMark(place, height, kind, 3.2));
        this.marks[i] = [CUT_LEFT + place, CUT_TOP + height];
      }
      if (Number.isFinite(deviation[i])) low.push([place, deviation[i], kind, 1.4 + 2.4 * Math.sqrt(weight[i] / heaviest), i]);
    }
    this.panel(CUT_TOP, CUT_HEIGHT, y, label, inside);
    let top = CUT_TOP + CUT_HEIGHT;
    if (count) {
      top += CUT_GAP + CUT_TOP / 2;
      const shown = [...deviation].filter((_, i) => used(i));
      const axis = new CutAxis(this.range("deviation", cutRange(shown, { centred: true, least: 3 }), header.dragging), CUT_LOW, 0);
      const band = low.length
        ? drawn("rect", { x: 0, width, y: axis.at(1), height: axis.at(-1) - axis.at(1), class: "band" })
        : drawn("text", { x: width / 2, y: CUT_LOW / 2 - 6, "text-anchor": "middle" }, "not measured");
      const marks = low.map(([place, value, kind, radius, i]) => {
        const height = Math.min(Math.max(axis.at(value), 2), CUT_LOW - 2);
        this.marks[i] ??= [CUT_LEFT + place, top + height];
        return cutMark(place, height, kind, radius);
      });
      this.panel(top, CUT_LOW, axis, "measured − model, in standard deviations", [band, ...marks]);
      top += CUT_LOW;
    }
    if (cut.difference.length) {
      top += CUT_GAP + CUT_TOP / 2;
      const curve = cut.difference.subarray(k * size, (k + 1) * size);
      const axis = new CutAxis(this.range("difference", cutRange(curve, { centred: true, least: 1e-3 }), header.dragging), CUT_LOW, 0);
      this.panel(top, CUT_LOW, axis, `difference: ${cut.names[cut.active]} − ${cut.names[cut.compare]}`, [this.path(x, curve, axis, { class: "difference" }, name === "aolp")]);
      top += CUT_LOW;
    }
    const words = drawn("g", { class: "words" });
    for (const tick of angleTicks(this.x.low, this.x.high, width < 300 ? 5 : 8)) words.append(drawn("text", { x: CUT_LEFT + this.x.at(tick), y: top + 15, "text-anchor": "middle" }, written(tick, 4)));
    words.append(drawn("text", { x: CUT_LEFT + width / 2, y: top + 31, "text-anchor": "middle", class: "axis" }, header.axis));
    this.cursor = drawn("line", { class: "cursor", y1: CUT_TOP, y2: top });
    this.ring = drawn("circle", { class: "ring", r: 7 });
    this.node.append(words, this.cursor, this.ring);
    this.node.setAttribute("viewBox", `0 0 ${this.whole} ${top + CUT_BOTTOM}`);
  }

  // Show the cursor; `point` is the index of a point, null for none.
  point(x, point) {
    const place = CUT_LEFT + this.x.at(x);
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, place);
    const mark = point === null ? null : this.marks[point];
    this.ring.setAttribute("visibility", mark ? "visible" : "hidden");
    if (mark) { this.ring.setAttribute("cx", mark[0]); this.ring.setAttribute("cy", mark[1]); }
  }

  // Where the pointer is in units of the drawing.
  where(event) {
    const box = this.node.getBoundingClientRect(), scale = this.whole / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
  }

  nearest([x, y]) {
    let best = null, least = CUT_NEAR;
    this.marks.forEach((mark, i) => {
      const distance = Math.hypot(mark[0] - x, mark[1] - y);
      if (distance < least) { least = distance; best = i; }
    });
    return best;
  }
}

function cutMark(x, y, kind, radius) {
  if (kind === "off") return drawn("path", { class: "mark-off", d: `M${x - 3} ${y - 3}l6 6m0-6l-6 6` });
  return drawn("circle", { class: `mark-${kind}`, cx: x, cy: y, r: radius });
}

// What the other views do not show.
const ONLY_CUTS = { views: ["cuts"] };

// Switch points of the data off, or on again; they are named by their row in the data set.
function switchPoints(app, rows, on) {
  app.change(state => {
    const data = state.settings.data ??= {};
    const off = new Set(listOf(data.off));
    for (const row of rows) if (on) off.delete(row); else off.add(row);
    data.off = [...off].sort((a, b) => a - b);
  }, ONLY_CUTS);
}

VIEWS.push({
  name: "cuts",
  title: "Curves",
  wide: true,
  build(place, app) {
    const looks = app.catalogue.looks;
    const set = (edit, options = ONLY_CUTS) => app.change(state => edit(state.settings.cuts ??= {}, state), options);
    const lineId = freshId("line"), angleId = freshId("angle");
    const line = element("select", { id: lineId, onchange: () => set((settings, state) => {
      const chosen = cut?.header.cuts[Number(line.value)];
      settings.along = chosen ? "data" : line.value;
      if (!chosen) { delete settings.cut; return; }
      settings.cut = { kind: chosen.kind, constant: chosen.constant, group: chosen.group };
      if (settings.follow && chosen.kind === "theta_i") state.light.theta_i = Math.round(chosen.constant * 1e3) / 1e3;
    }, {}) });
    const angleLabel = element("label", { for: angleId });
    const angle = element("input", { type: "number", id: angleId, class: "number", step: "any", onchange: () => {
      if (angle.value !== "") set(settings => { settings[settings.along === "phi" ? "theta_r" : "phi"] = Number(angle.value); });
    } });
    const angleField = element("div", { class: "field short" }, angleLabel, angle);
    const check = (text, onchange) => {
      const input = element("input", { type: "checkbox", onchange: () => onchange(input.checked) });
      return { input, node: element("label", { class: "check" }, input, text) };
    };
    const log = check("logarithmic intensity", on => set(settings => { settings.logarithmic = on; }));
    const follow = check("light follows", on => set((settings, state) => {
      settings.follow = on;
      const chosen = cut?.header.cuts[Number(line.value)];
      if (on && chosen?.kind === "theta_i") state.light.theta_i = Math.round(chosen.constant * 1e3) / 1e3;
    }, {}));
    const legend = element("ul", { class: "key" });
    const note = element("p", { class: "about", role: "status" });
    const readout = element("p", { class: "readout" });
    const plots = element("div", {
      class: "plots", tabindex: 0, role: "slider", "aria-label": "Place along the curves",
      "aria-description": "Left and right: along the curve or from point to point. Space: switch the point off or on.",
    });
    const table = element("table"), rows = element("details", { hidden: true }, element("summary", {}), table);
    place.append(element("div", { class: "curves" },
      element("div", { class: "line" },
        element("div", { class: "field" }, element("label", { for: lineId }, "Along"), line), angleField, log.node, follow.node),
      legend, plots, readout, note, rows));
    let cut = null, plotted = [], drawnAt = 0, offered = "", pointer = { x: null, point: null };

    const settings = () => app.state.settings.cuts ?? {};
    // Beside the points or along the curve, in words.
    const say = () => {
      const { header, x, at, points, curves } = cut;
      const size = header.count, many = header.quantities.length, { point } = pointer;
      const there = point === null ? pointer.x : at[point];
      let index = 0;
      for (let i = 1; i < size; ++i) if (Math.abs(x[i] - there) < Math.abs(x[index] - there)) index = i;
      const parts = header.quantities.map(({ name: quantity, label }, k) => {
        // of what is a share of the light, the last digits are rounding
        const rounded = value => quantity !== "intensity" && quantity !== "m00" && Math.abs(value) < CUT_NOTHING ? 0 : value;
        const models = header.layers.map((layer, i) => [cut.names[layer], rounded(curves[(i * many + k) * size + index])])
          .filter(([, value]) => Number.isFinite(value)).map(([name, value]) => `${name} ${written(value, 4)}`);
        if (point === null) return `${label}: ${models.join(", ") || "none"}`;
        const [measured, std, deviation, weight] = [0, 1, 2, 3].map(j => points[(4 * k + j) * at.length + point]);
        if (!Number.isFinite(measured)) return `${label}: not measured`;
        const far = Number.isFinite(deviation) ? `, ${written(deviation, 2)} standard deviations from the model, weight ${written(weight, 2)}` : "";
        return `${label}: measured ${withError(measured, std)}, ${models.join(", ")}${far}`;
      });
      const kind = point === null ? "" : header.off[point] ? "switched off, " : header.held_out[point] ? "held out, " : "used, ";
      const text = `${kind}${written(there, 4)}°: ${parts.join("; ")}`;
      readout.textContent = text;
      plots.setAttribute("aria-valuetext", text);
      plots.setAttribute("aria-valuenow", there);
    };
    const move = (x, point) => {
      pointer = { x, point };
      for (const plot of plotted) plot.point(x, point);
      say();
    };
    const turn = point => switchPoints(app, [cut.header.rows[point]], cut.header.off[point]);
    plots.addEventListener("pointermove", event => {
      const plot = plotted.find(p => p.node.contains(event.target));
      if (!plot || !cut) return;
      const [x, y] = plot.where(event), point = plot.nearest([x, y]);
      const along = Math.min(Math.max(plot.x.back(x - CUT_LEFT), cut.x[0]), cut.x[cut.x.length - 1]);
      plots.classList.toggle("pointing", point !== null);
      move(point === null ? along : cut.at[point], point);
    });
    plots.addEventListener("click", event => {
      const plot = plotted.find(p => p.node.contains(event.target));
      const point = plot && cut ? plot.nearest(plot.where(event)) : null;
      if (point !== null) turn(point);
    });
    plots.addEventListener("keydown", event => {
      if (!cut || event.ctrlKey || event.altKey || event.metaKey) return;
      const { at, x } = cut, step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -5, PageUp: 5, Home: -Infinity, End: Infinity }[event.key];
      if (step !== undefined) {
        event.preventDefault();
        const within = (value, low, high) => Math.min(Math.max(value, low), high);
        if (at.length) {
          const from = pointer.point ?? (step > 0 ? -1 : at.length);
          const point = within(from + step, 0, at.length - 1);
          move(at[point], point);
        } else move(within(pointer.x + step * (x[x.length - 1] - x[0]) / 60, x[0], x[x.length - 1]), null);
      } else if ((event.key === " " || event.key === "Enter") && pointer.point !== null) {
        event.preventDefault();
        turn(pointer.point);
      }
    });

    const offerLines = header => {
      const along = settings().along ?? "data";
      const text = JSON.stringify(header.cuts);
      if (text !== offered) {
        offered = text;
        line.replaceChildren(
          element("option", { value: "theta_r" }, "viewing angle, at the light's θi"),
          element("option", { value: "phi" }, "azimuth, at the light's θi"));
        if (header.cuts.length) line.append(element("optgroup", { label: "as measured" }, header.cuts.map(({ label }, i) => element("option", { value: String(i) }, label))));
      }
      const index = header.cuts.findIndex(({ label }) => label === header.title);
      line.value = along === "data" ? (index >= 0 ? String(index) : "theta_r") : along;
      const measured = line.value !== "theta_r" && line.value !== "phi";
      angleLabel.textContent = along === "phi" ? "at θr (°)" : "in azimuth φ (°)";
      angle.disabled = measured;
      if (angle.getRootNode().activeElement !== angle) angle.value = along === "phi" ? settings().theta_r ?? app.state.light.theta_i : settings().phi ?? 0;
      follow.input.disabled = header.cuts[index]?.kind !== "theta_i";
      follow.input.checked = settings().follow === true;
      log.input.checked = settings().logarithmic !== false;
    };
    const describe = header => {
      const sample = kind => drawn("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" }, cutMark(17, 7, kind, 4));
      const entries = header.layers.map(layer => element("li", {},
        drawn("svg", { viewBox: "0 0 34 14", "aria-hidden": "true" },
          drawn("line", { x1: 1, x2: 33, y1: 7, y2: 7, stroke: looks[layer % looks.length].colour, "stroke-width": 2.5, "stroke-dasharray": looks[layer % looks.length].dash.join(" ") })),
        cut.names[layer] + (layer === cut.active && header.layers.length > 1 ? " (active)" : "")));
      if (cut.at.length) entries.push(element("li", {}, sample("used"), `${header.data}, below: larger with more weight`));
      if (header.held_out.some(Boolean)) entries.push(element("li", {}, sample("held"), "held out"));
      if (header.off.some(Boolean)) entries.push(element("li", {}, sample("off"), "switched off"));
      legend.replaceChildren(...entries);
    };
    const list = () => {
      const { header, at, points } = cut;
      rows.hidden = at.length === 0;
      rows.firstChild.textContent = `The ${at.length} points on this line`;
      if (rows.hidden || !rows.open) { table.replaceChildren(); return; }
      const value = (k, j, i) => points[(4 * k + j) * at.length + i];
      table.replaceChildren(
        element("thead", {}, element("tr", {}, ["used", header.axis, ...header.quantities.flatMap(q => [q.label, "deviation / σ"])].map(text => element("th", { scope: "col" }, text)))),
        element("tbody", {}, [...at].map((x, i) => {
          const box = element("input", { type: "checkbox", checked: !header.off[i], "aria-label": `use the point at ${written(x, 4)}°`, onchange: () => switchPoints(app, [header.rows[i]], box.checked) });
          const numbers = header.quantities.flatMap((_, k) => {
            const [measured, std, deviation] = [0, 1, 2].map(j => value(k, j, i));
            if (!Number.isFinite(measured)) return ["–", "–"];
            return [withError(measured, std), Number.isFinite(deviation) ? written(deviation, 2) : "–"];
          });
          return element("tr", {}, element("td", {}, box), [`${written(x, 4)}°`, ...numbers].map(text => element("td", {}, text)));
        })));
    };
    const redraw = () => {
      plotted.forEach((plot, k) => plot.draw(cut, k, settings(), looks));
      drawnAt = plots.clientWidth;
    };
    new ResizeObserver(() => {
      if (!cut || !plotted.length || Math.abs(plots.clientWidth - drawnAt) < 2) return;
      redraw();
      move(pointer.x, pointer.point);
    }).observe(plots);
    rows.addEventListener("toggle", () => { if (cut) list(); });

    return {
      show(header, buffers) {
        note.textContent = header.error ?? header.note ?? "";
        if (header.error || !app.state) return;
        const focused = rows.contains(rows.getRootNode().activeElement) ? [...table.querySelectorAll("input")].indexOf(rows.getRootNode().activeElement) : -1;
        const { active, compare, layers } = app.state;
        cut = {
          header, active, compare, names: layers.map(layer => layer.name),
          x: doubles(buffers[0]), curves: singles(buffers[1]), difference: singles(buffers[2]), at: doubles(buffers[3]), points: doubles(buffers[4]),
        };
        // a layer that has gone meanwhile: another picture is on its way
        if (header.layers.some(layer => layer >= layers.length)) return;
        while (plotted.length > header.quantities.length) plotted.pop().node.remove();
        while (plotted.length < header.quantities.length) { plotted.push(new CutPlot()); plots.append(plotted[plotted.length - 1].node); }
        redraw();
        offerLines(header);
        plots.setAttribute("aria-valuemin", cut.x[0]);
        plots.setAttribute("aria-valuemax", cut.x[cut.x.length - 1]);
        const point = pointer.point !== null && pointer.point < cut.at.length ? pointer.point : null;
        const x = point === null ? Math.min(Math.max(pointer.x ?? 0, cut.x[0]), cut.x[cut.x.length - 1]) : cut.at[point];
        move(x, point);
        if (header.dragging) return;
        describe(header);
        list();
        if (focused >= 0) table.querySelectorAll("input")[focused]?.focus();
      },
    };
  },
});
