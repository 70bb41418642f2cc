// A ball as a polarisation camera sees it: radiance, behind a polariser that is turned, degree and angle of
// polarisation. The Stokes vectors come in the camera's axes, the polarisers as vectors to multiply them with. Painted
// here and not by a shader, as fields over hemispheres are (graphics.js).

// This much of the square's half side, in radii, is shown around the ball's middle.
const BALL_REACH = 1.02;
// The polariser's disc in the lower right corner, in radii of the ball.
const DISC = { x: 0.85, y: -0.85, radius: 0.15 };

// What the modes of the picture are called, and the units of their numbers.
const BALL_MODES = {
  radiance: { text: "Radiance", title: "radiance", unit: "sr⁻¹", scale: 1 },
  polariser: { text: "Polariser", title: "radiance behind a polariser", unit: "sr⁻¹", scale: 1 },
  dolp: { text: "DoLP", title: "degree of linear polarisation", unit: "%", scale: 100 },
  aolp: { text: "AoLP", title: "angle of linear polarisation", unit: "°", scale: 180 / Math.PI },
  circular: { text: "V/I", title: "circular polarisation", unit: "%", scale: 100 },
};

// The tone curve, over radiances up to so many times that of which it makes 1 − 1/e.
const TONES = 4;
function toned(share) {
  const x = 1 - Math.exp(-TONES * share);
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}
const greys = Uint8Array.from({ length: 1024 }, (_, i) => i % 4 === 3 ? 255 : toned((i >> 2) / 255));
// In so many levels that the dark ones are a step of a byte.
const greyLevels = Uint32Array.from({ length: 1 << 15 }, (_, i) => {
  const grey = toned(i / ((1 << 15) - 1));
  return new Uint32Array(Uint8Array.of(grey, grey, grey, 255).buffer)[0];
});
const GREY = { shadow: 64, unpolarised: 128 };

// Where each pixel of a square lies on the ball: row of the grid, part of a turn, place; for pictures of that size.
const ballMaps = new Map();
function ballMap(size, rows, rim) {
  const key = [size, rows, rim].join();
  if (ballMaps.has(key)) return ballMaps.get(key);
  if (ballMaps.size > 3) ballMaps.clear();
  const scale = 2 * BALL_REACH / size, most = size * size;
  const map = { scale, pixel: new Uint32Array(most), row: new Float32Array(most), turn: new Float32Array(most),
    x: new Float32Array(most), y: new Float32Array(most), z: new Float32Array(most), rim: [] };
  let count = 0;
  for (let j = 0; j < size; j++) for (let i = 0; i < size; i++) {
    const x = (i + 0.5 - size / 2) * scale, y = (size / 2 - j - 0.5) * scale, radius = Math.hypot(x, y),
      cover = (1 - radius) / scale + 0.5;
    if (cover <= 0) continue;
    const zenith = Math.asin(Math.min(radius, 1));
    map.pixel[count] = j * size + i;
    // the last row stands for what is beyond it
    map.row[count] = Math.min(zenith / rim, 1 - 1e-6) * (rows - 1);
    map.turn[count] = (Math.atan2(y, x) / (2 * Math.PI) + 1) % 1;
    map.x[count] = x;
    map.y[count] = y;
    map.z[count] = Math.cos(zenith);
    if (cover < 1) map.rim.push(count, Math.round(255 * cover));
    count++;
  }
  for (const name of ["pixel", "row", "turn", "x", "y", "z"]) map[name] = map[name].slice(0, count);
  ballMaps.set(key, map);
  return map;
}

// Corner before each pixel and share of the way to the next column, with the lamp at an azimuth in degrees.
function ballCorners(map, columns, azimuth) {
  const { row, turn } = map, whole = columns - 1, shift = (azimuth / 360 % 1 + 1) % 1 * whole, count = row.length;
  if (map.shift === shift && map.columns === columns) return;
  map.corner ??= new Uint32Array(count);
  map.along ??= new Float32Array(count);
  for (let k = 0; k < count; k++) {
    let c = turn[k] * whole - shift;
    if (c < 0) c += whole;
    const c0 = Math.min(c | 0, whole - 1);
    map.corner[k] = (row[k] | 0) * columns + c0;
    map.along[k] = c - c0;
  }
  map.shift = shift;
  map.columns = columns;
}

// A number between four corners of a grid, `step` numbers a point.
function blended(values, corner, columns, wr, wc, step = 1, offset = 0) {
  const at = corner * step + offset, below = at + columns * step;
  const upper = values[at] + (values[at + step] - values[at]) * wc,
    lower = values[below] + (values[below + step] - values[below]) * wc;
  return upper + (lower - upper) * wr;
}

// float16 numbers from their bits.
function halfFloats(bits) {
  const numbers = allHalfNumbers(), values = new Float32Array(bits.length);
  for (let k = 0; k < bits.length; k++) values[k] = numbers[bits[k]];
  return values;
}

// A pixel's colour on the way to a grey.
function towardsGrey(colour, grey, share) {
  const mixed = shift => Math.round((colour >> shift & 255) * (1 - share) + grey * share) << shift;
  return (0xff000000 | mixed(16) | mixed(8) | mixed(0)) >>> 0;
}

VIEWS.push({
  name: "sphere",
  title: "Lit ball",
  build(place, app) {
    const canvas = element("canvas", { width: 450, height: 450, class: "ball", role: "img",
      "aria-label": "A lit ball as a polarisation camera sees it" });
    const pen = canvas.getContext("2d");
    const tables = Object.fromEntries(Object.entries(app.catalogue.colours).map(([name, text]) =>
      [name, decoded(text)]));
    let header = null, fields = [], polarisers = null, handled = false, image = null;

    const settings = () => ({ mode: "radiance", polariser: 0, exposure: 0, ...app.state?.settings.sphere });
    const lamp = () => {
      const [polar, azimuth] = header?.lamp ?? [0, 0];
      return { polar, azimuth, ...app.state?.settings.sphere?.light };
    };
    const set = (values, dragging, views) => app.change(state => {
      state.settings.sphere = { ...state.settings.sphere, ...values };
    }, { dragging, views });
    // what the page alone draws needs no picture from Dr.Jit
    const show = (name, value, dragging = false) => set({ [name]: value }, dragging, []);
    const light = (values, dragging) => set({ light: { ...lamp(), ...values } }, dragging, ["sphere"]);

    const slider = (name, symbol, about, unit, lower, upper, set) => {
      const row = sliderRow({ name: `sphere-${name}`, symbol, about, unit, lower, upper, least: lower, most: upper },
        set);
      row.node.dataset.place = `settings.sphere.${name}`;
      return row;
    };
    const mode = choiceRow("What the ball shows", Object.entries(BALL_MODES).map(([value, { text, title }]) =>
      ({ value, text, title })), value => show("mode", value));
    const dial = slider("polariser", "α", "polariser, from level", "°", 0, 180, (value, dragging) =>
      show("polariser", value, dragging));
    const exposure = slider("exposure", "EV", "exposure", "stops", -8, 8, (value, dragging) =>
      show("exposure", value, dragging));
    const polar = slider("light.polar", "θ", "lamp, from the camera", "°", 0, 180, (value, dragging) =>
      light({ polar: value }, dragging));
    const azimuth = slider("light.azimuth", "ψ", "lamp, around the ball from the right", "°", 0, 360,
      (value, dragging) => light({ azimuth: value }, dragging));
    const legend = new ColourLegend();
    const readout = element("p", { class: "read" });
    place.append(
      mode.node, canvas, legend.node, readout, dial.node, exposure.node,
      element("details", { class: "elements" }, element("summary", {}, "Lamp: drag on the ball, or here"), polar.node,
        azimuth.node,
        element("p", { class: "about" }, "Angles of polarisation are those of the picture: 0° is level, ",
          "counterclockwise. Of polarised light p lies in the plane of lamp and camera.")),
    );

    function range() {
      const { mode } = settings(), both = fields.length > 1;
      if (mode === "aolp") return [-Math.PI / 2, Math.PI / 2];
      const most = header.ranges[mode === "polariser" ? "radiance" : mode];
      return both || mode === "circular" ? [-most, most] : [0, most];
    }

    // What the colours stand for, at the grid's points; not for angles.
    function scalars(values, { mode, polariser }) {
      const count = values.length / 4, found = new Float32Array(count);
      // the dial stands between two of the polarisers at most by rounding
      const at = 4 * Math.round(polariser % 180 / 180 * (polarisers.length / 4 - 1)),
        [a, b, c, d] = polarisers.subarray(at, at + 4);
      for (let k = 0; k < count; k++) {
        const L = values[4 * k], q = values[4 * k + 1], u = values[4 * k + 2], v = values[4 * k + 3];
        if (mode === "radiance") found[k] = L;
        else if (mode === "polariser") found[k] = L * (a + b * q + c * u + d * v);
        else found[k] = mode === "dolp" ? Math.sqrt(q * q + u * u) : v;
      }
      return found;
    }

    function redraw() {
      if (!header) return;
      const chosen = settings(), both = fields.length > 1, known = BALL_MODES[chosen.mode];
      if (!known) return;
      const [rows, columns] = header.shape, size = canvas.width, map = ballMap(size, rows, header.rim);
      const tone = !both && ["radiance", "polariser"].includes(chosen.mode), gain = Math.PI * 2 ** chosen.exposure;
      const name = chosen.mode === "aolp" ? "cyclic" : both || chosen.mode === "circular" ? "signed" : "sequential";
      const table = tone ? greyLevels : levelTable(app.catalogue.colours[name]);
      const [low, high] = tone ? [0, TONES / gain] : range(), last = table.length - 1, scale = last / (high - low);
      if (image?.width !== size) image = pen.createImageData(size, size);
      const pixels = new Uint32Array(image.data.buffer), { pixel } = map;
      ballCorners(map, columns, header.lamp[1]);
      const { corner, along, row } = map, count = pixel.length;
      if (chosen.mode === "aolp") {
        // axes have no jump where their angles have one: what turns with twice the angle is blended
        const [values, others] = fields;
        for (let k = 0; k < count; k++) {
          const wr = row[k] - (row[k] | 0), wc = along[k];
          let q = blended(values, corner[k], columns, wr, wc, 4, 1),
            u = blended(values, corner[k], columns, wr, wc, 4, 2), dolp = Math.sqrt(q * q + u * u);
          if (both) {
            const p = blended(others, corner[k], columns, wr, wc, 4, 1),
              v = blended(others, corner[k], columns, wr, wc, 4, 2);
            dolp = Math.min(dolp, Math.sqrt(p * p + v * v));
            [q, u] = [q * p + u * v, u * p - q * v];
          }
          const share = shareOfAngle(dolp), colour = table[(0.5 * Math.atan2(u, q) - low) * scale + 0.5 | 0];
          pixels[pixel[k]] = share < 1 ? towardsGrey(colour, GREY.unpolarised, 1 - share) : colour;
        }
      } else {
        const shown = scalars(fields[0], chosen);
        if (both) {
          const other = scalars(fields[1], chosen);
          for (let k = 0; k < shown.length; k++) shown[k] -= other[k];
        }
        for (let k = 0; k < shown.length; k++) shown[k] = (shown[k] - low) * scale + 0.5;
        for (let k = 0; k < count; k++) {
          const at = corner[k], below = at + columns, wc = along[k], r = row[k],
            upper = shown[at] + (shown[at + 1] - shown[at]) * wc;
          const level = upper + (shown[below] + (shown[below + 1] - shown[below]) * wc - upper) * (r - (r | 0)) | 0;
          pixels[pixel[k]] = table[level < 0 ? 0 : level > last ? last : level];
        }
      }
      if (!["radiance", "polariser"].includes(chosen.mode)) {
        // the shadow's edge lies between the grid's points
        const [x, y, z] = header.towards_lamp;
        for (let k = 0; k < pixel.length; k++) {
          const lit = (x * map.x[k] + y * map.y[k] + z * map.z[k]) / map.scale;
          if (lit < 1) pixels[pixel[k]] = towardsGrey(pixels[pixel[k]], GREY.shadow, lit > 0 ? 1 - lit : 1);
        }
      }
      for (let k = 0; k < map.rim.length; k += 2) image.data[4 * pixel[map.rim[k]] + 3] = map.rim[k + 1];
      pen.putImageData(image, 0, 0);
      if (chosen.mode === "polariser") drawDisc(chosen.polariser);
      if (handled) drawHandle();
      legend.show(tone ? greys : tables[name], [low * known.scale, high * known.scale], known.unit,
        both ? `${known.text}: ${header.models[0]} − ${header.models[1]}` : known.title);
    }

    // From places in radii to the canvas.
    const placed = (x, y) => [(x / BALL_REACH + 1) * canvas.width / 2, (1 - y / BALL_REACH) * canvas.width / 2];

    // The polariser, with stripes along the axis that passes.
    function drawDisc(angle) {
      const [x, y] = placed(DISC.x, DISC.y), radius = DISC.radius * canvas.width / 2 / BALL_REACH,
        ratio = canvas.width / Math.max(canvas.clientWidth, 1);
      pen.save();
      pen.translate(x, y);
      pen.rotate(-angle * Math.PI / 180);
      pen.strokeStyle = "#808080";
      pen.lineWidth = 1.5 * ratio;
      pen.beginPath();
      pen.arc(0, 0, radius, 0, 2 * Math.PI);
      pen.stroke();
      pen.clip();
      pen.lineWidth = radius / 7;
      pen.beginPath();
      for (let k = -3; k <= 3; k++) { pen.moveTo(-radius, k * radius / 3.5); pen.lineTo(radius, k * radius / 3.5); }
      pen.stroke();
      pen.restore();
    }

    function drawHandle() {
      const [x, y] = placed(...highlight()), ratio = canvas.width / Math.max(canvas.clientWidth, 1);
      for (const [width, ink] of [[4, "#fff"], [2, "#000"]]) {
        pen.lineWidth = width * ratio;
        pen.strokeStyle = ink;
        pen.beginPath();
        pen.arc(x, y, 12 * ratio, 0, 2 * Math.PI);
        pen.stroke();
      }
    }

    // where the ball mirrors the lamp, from its middle in radii
    function highlight() {
      const { polar, azimuth } = lamp(), radius = Math.sin(polar * Math.PI / 360), a = azimuth * Math.PI / 180;
      return [radius * Math.cos(a), radius * Math.sin(a)];
    }

    function update() {
      const chosen = settings(), { polar: p, azimuth: a } = lamp();
      mode.show(chosen.mode);
      dial.node.hidden = chosen.mode !== "polariser";
      exposure.node.hidden = fields.length > 1 || !["radiance", "polariser"].includes(chosen.mode);
      dial.show(chosen.polariser);
      exposure.show(chosen.exposure);
      polar.show(p);
      azimuth.show(a);
      redraw();
    }

    const pointed = event => {
      const box = canvas.getBoundingClientRect();
      return [(2 * (event.clientX - box.left) / box.width - 1) * BALL_REACH,
        (1 - 2 * (event.clientY - box.top) / box.height) * BALL_REACH];
    };

    function read(event) {
      const [x, y] = pointed(event), radius = Math.hypot(x, y);
      if (!header || radius > 1) { readout.textContent = "\u00a0"; return; }
      const turn = (Math.atan2(y, x) / (2 * Math.PI) - header.lamp[1] / 360 + 3) % 1, [rows, columns] = header.shape;
      const row = Math.min(Math.asin(radius) / header.rim, 1 - 1e-6) * (rows - 1), r0 = row | 0,
        column = turn * (columns - 1), c0 = Math.min(column | 0, columns - 2);
      readout.textContent = fields.map((values, i) => {
        const [L, q, u, v] = [0, 1, 2, 3].map(offset =>
          blended(values, r0 * columns + c0, columns, row - r0, column - c0, 4, offset));
        const angle = Math.atan2(u, q) / 2 * 180 / Math.PI;
        const name = fields.length > 1 ? `${header.models[i]}: ` : "";
        if (L <= 0) return `${name}in the shadow`;
        const dolp = Math.hypot(q, u), rounded = Number(angle.toFixed(1));
        const aolp = angleIsNone(dolp) ? "none" : `${written(rounded === -90 ? 90 : rounded)}°`;
        return `${name}${written(L)} sr⁻¹, DoLP ${written(100 * dolp)} %, AoLP ${aolp}, V/I ${written(100 * v)} %`;
      }).join("; ");
    }

    const onDisc = ([x, y]) => settings().mode === "polariser" && Math.hypot(x - DISC.x, y - DISC.y) < DISC.radius;
    const turn = ([x, y], dragging) => {
      const angle = Math.atan2(y - DISC.y, x - DISC.x) * 180 / Math.PI;
      show("polariser", Number(((angle + 360) % 180).toFixed(1)) % 180, dragging);
    };
    let grip = null;
    const drop = event => {
      if (grip?.disc) show("polariser", settings().polariser);
      else if (grip?.moved) light({}, false);
      grip = null;
      handled = event.type !== "pointerleave" && event.pointerType === "mouse";
      redraw();
    };
    canvas.addEventListener("pointerdown", event => {
      if (event.button) return;
      canvas.setPointerCapture(event.pointerId);
      grip = { x: event.clientX, y: event.clientY, moved: false, disc: onDisc(pointed(event)) };
      if (grip.disc) turn(pointed(event), true);
    });
    canvas.addEventListener("pointermove", event => {
      read(event);
      if (grip?.disc) { turn(pointed(event), true); return; }
      if (!handled) { handled = true; redraw(); }
      if (!grip) return;
      // a click that trembles moves nothing
      grip.moved ||= Math.hypot(event.clientX - grip.x, event.clientY - grip.y) > 4;
      if (!grip.moved) return;
      const [x, y] = pointed(event);
      const polar = 2 * Math.asin(Math.min(Math.hypot(x, y), 1)) * 180 / Math.PI,
        around = Math.atan2(y, x) * 180 / Math.PI;
      light({ polar: Number(polar.toFixed(1)), azimuth: Number(((around + 360) % 360).toFixed(1)) % 360 }, true);
    });
    canvas.addEventListener("pointerup", drop);
    canvas.addEventListener("pointercancel", drop);
    canvas.addEventListener("pointerleave", event => { if (!grip) { readout.textContent = "\u00a0"; drop(event); } });
    readout.textContent = "\u00a0";
    keepSharp(canvas, redraw, 1200);
    // a moved slider has its picture to come; what stands is drawn again where the ball's settings are others
    let followed = "";
    app.on("state", () => {
      const now = JSON.stringify(settings());
      if (now !== followed) update();
      followed = now;
    });
    return {
      show(content, buffers) {
        header = content;
        const copied = buffer => buffer.buffer.slice(buffer.byteOffset, buffer.byteOffset + buffer.byteLength);
        fields = buffers.slice(0, -1).map(buffer => halfFloats(new Uint16Array(copied(buffer))));
        polarisers = new Float32Array(copied(buffers.at(-1)));
        update();
      },
    };
  },
});
