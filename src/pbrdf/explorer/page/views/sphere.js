// A ball as a polarisation camera sees it: radiance, behind a polariser that is turned, degree and angle of
// polarisation. The Stokes vectors come in the camera's axes, the polarisers as vectors to multiply them with.

const BALL = `#version 300 es
precision highp float;
in vec2 at;
uniform sampler2D field, other, table;
uniform vec4 analyser;
uniform vec3 lamp;
uniform vec2 range, handle, axis;
uniform float azimuth, rim, gain, pixel;
uniform int mode;
uniform bool difference, handled;
out vec4 colour;
const float PI = 3.14159265, MARGIN = 1.02;
// the polariser's disc stands in the lower right corner
const vec3 DISC = vec3(0.85, -0.85, 0.15);

// radiance and its shares Q, U, V at a place of the ball
vec4 seen(sampler2D values, float zenith, float turn) {
  vec2 size = vec2(textureSize(values, 0));
  vec2 cell = vec2(turn / (2.0 * PI), min(zenith / rim, 1.0)) * (size - 1.0) + 0.5;
  return texture(values, cell / size);
}

float shown(vec4 s) {
  if (mode == 0) return s.x;
  if (mode == 1) return s.x * dot(analyser, vec4(1.0, s.yzw));
  if (mode == 2) return length(s.yz);
  if (mode == 3) return 0.5 * atan(s.z, s.y);
  return s.w;
}

vec3 toned(float radiance) {
  float x = 1.0 - exp(-gain * radiance);
  return vec3(x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055);
}

vec3 coloured(float value) {
  return texture(table, vec2((value - range.x) / (range.y - range.x), 0.5)).rgb;
}

void main() {
  vec2 w = (2.0 * at - 1.0) * MARGIN;
  float radius = length(w);
  float cover = clamp((1.0 - radius) / pixel + 0.5, 0.0, 1.0);
  float zenith = asin(min(radius, 1.0)), turn = mod(atan(w.y, w.x) - azimuth, 2.0 * PI);
  vec4 s = seen(field, zenith, turn);
  float value = shown(s);
  vec3 picture;
  if (difference) {
    vec4 t = seen(other, zenith, turn);
    float step = value - shown(t);
    if (mode == 3) step -= PI * round(step / PI);
    picture = coloured(step);
  } else if (mode < 2) picture = toned(value);
  else if (mode == 3) picture = mix(vec3(0.5), coloured(value), smoothstep(0.0, 0.01, length(s.yz)));
  else picture = coloured(value);
  // the shadow's edge lies between the grid's points
  float cosine = dot(lamp, vec3(w, sqrt(max(1.0 - radius * radius, 0.0))));
  if (mode > 1) picture = mix(vec3(0.25), picture, clamp(cosine / pixel, 0.0, 1.0));
  if (handled) {
    float ring = abs(length(w - handle) - 0.06) / pixel;
    picture = mix(vec3(ring < 1.2 ? 0.0 : 1.0), picture, smoothstep(2.0, 3.0, ring));
  }
  colour = vec4(picture * cover, cover);
  vec2 p = w - DISC.xy;
  if (mode == 1 && length(p) < DISC.z + pixel) {
    float rim = 1.0 - clamp((DISC.z - 2.0 * pixel - length(p)) / pixel, 0.0, 1.0), edge = clamp((DISC.z - length(p)) / pixel, 0.0, 1.0);
    // stripes along the axis that passes
    float stripe = smoothstep(0.25, 0.4, abs(fract(dot(p, vec2(-axis.y, axis.x)) * 20.0 + 0.5) - 0.5));
    colour = vec4(vec3(0.5), 1.0) * max(rim, 0.75 * stripe) * edge;
  }
}`;

const DISC = { x: 0.85, y: -0.85, radius: 0.15 };

// What the modes of the picture are called, and the units of their numbers.
const BALL_MODES = {
  radiance: { text: "Radiance", title: "radiance", unit: "sr⁻¹", scale: 1 },
  polariser: { text: "Polariser", title: "radiance behind a polariser", unit: "sr⁻¹", scale: 1 },
  dolp: { text: "DoLP", title: "degree of linear polarisation", unit: "%", scale: 100 },
  aolp: { text: "AoLP", title: "angle of linear polarisation", unit: "°", scale: 180 / Math.PI },
  circular: { text: "V/I", title: "circular polarisation", unit: "%", scale: 100 },
};

// Greys of the tone curve over radiances up to this many times that of which it makes 1 − 1/e.
const TONES = 4;
const greys = Uint8Array.from({ length: 1024 }, (_, i) => {
  if (i % 4 === 3) return 255;
  const x = 1 - Math.exp(-TONES * Math.floor(i / 4) / 255);
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
});

// Four channels of a float16 field between its grid points, as the graphics card interpolates.
function between(view, [rows, columns], row, column) {
  const y = Math.min(Math.max(row, 0), rows - 1), x = Math.min(Math.max(column, 0), columns - 1);
  const y0 = Math.floor(y), x0 = Math.floor(x), y1 = Math.min(y0 + 1, rows - 1), x1 = Math.min(x0 + 1, columns - 1);
  const at = (j, i, c) => halfNumber(view.getUint16(2 * (4 * (j * columns + i) + c), true));
  const mixed = (a, b, t) => a + (b - a) * t;
  return [0, 1, 2, 3].map(c => mixed(mixed(at(y0, x0, c), at(y0, x1, c), x - x0), mixed(at(y1, x0, c), at(y1, x1, c), x - x0), y - y0));
}

VIEWS.push({
  name: "sphere",
  title: "Lit ball",
  build(place, app) {
    const canvas = element("canvas", { width: 450, height: 450, class: "ball", role: "img", "aria-label": "A lit ball as a polarisation camera sees it" });
    const graphics = new Graphics(canvas, BALL);
    graphics.gl.enable(graphics.gl.BLEND);
    graphics.gl.blendFunc(graphics.gl.ONE, graphics.gl.ZERO);
    const tables = Object.fromEntries(Object.entries(app.catalogue.colours).map(([name, text]) => [name, decoded(text)]));
    let header = null, fields = [], polarisers = null, handled = false, table = "";

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
      const row = sliderRow({ name: `sphere-${name}`, symbol, about, unit, lower, upper, least: lower, most: upper }, set);
      row.node.dataset.place = `settings.sphere.${name}`;
      return row;
    };
    const mode = choiceRow("What the ball shows", Object.entries(BALL_MODES).map(([value, { text, title }]) => ({ value, text, title })), value => show("mode", value));
    const dial = slider("polariser", "α", "polariser, from level", "°", 0, 180, (value, dragging) => show("polariser", value, dragging));
    const exposure = slider("exposure", "EV", "exposure", "stops", -8, 8, (value, dragging) => show("exposure", value, dragging));
    const polar = slider("light.polar", "θ", "lamp, from the camera", "°", 0, 180, (value, dragging) => light({ polar: value }, dragging));
    const azimuth = slider("light.azimuth", "ψ", "lamp, around the ball from the right", "°", 0, 360, (value, dragging) => light({ azimuth: value }, dragging));
    const legend = new ColourLegend();
    const readout = element("p", { class: "read" });
    place.append(
      mode.node, canvas, legend.node, readout, dial.node, exposure.node,
      element("details", { class: "elements" }, element("summary", {}, "Lamp: drag on the ball, or here"), polar.node, azimuth.node,
        element("p", { class: "about" }, "Angles of polarisation are those of the picture: 0° is level, counterclockwise. Of polarised light p lies in the plane of lamp and camera.")),
    );

    function range() {
      const { mode } = settings(), both = fields.length > 1;
      if (mode === "aolp") return [-Math.PI / 2, Math.PI / 2];
      const most = header.ranges[mode === "polariser" ? "radiance" : mode];
      return both || mode === "circular" ? [-most, most] : [0, most];
    }

    function redraw() {
      if (!header) return;
      const chosen = settings(), both = fields.length > 1, known = BALL_MODES[chosen.mode];
      if (!known) return;
      const gain = Math.PI * 2 ** chosen.exposure;
      const gl = graphics.gl, index = Object.keys(BALL_MODES).indexOf(chosen.mode);
      const wanted = both || chosen.mode === "circular" ? "signed" : chosen.mode === "aolp" ? "cyclic" : "sequential";
      if (table !== wanted) { graphics.colours("table", tables[wanted]); table = wanted; }
      // the dial stands between two of the polarisers at most by rounding
      const step = Math.round(chosen.polariser % 180 / 180 * (polarisers.length / 4 - 1));
      graphics.vector("analyser", polarisers.subarray(4 * step, 4 * step + 4));
      graphics.integer("mode", index);
      graphics.integer("difference", both ? 1 : 0);
      graphics.integer("handled", handled ? 1 : 0);
      graphics.vector("range", range());
      graphics.vector("lamp", header.towards_lamp);
      graphics.vector("axis", [Math.cos(chosen.polariser * Math.PI / 180), Math.sin(chosen.polariser * Math.PI / 180)]);
      graphics.number("rim", header.rim);
      graphics.number("gain", gain);
      graphics.number("azimuth", header.lamp[1] * Math.PI / 180);
      graphics.number("pixel", 2.04 / canvas.width);
      graphics.vector("handle", highlight());
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      const tone = !both && index < 2, ends = tone ? [0, TONES / gain] : range().map(v => v * known.scale);
      legend.show(tone ? greys : tables[wanted], ends, known.unit, both ? `${known.text}: ${header.models[0]} − ${header.models[1]}` : known.title);
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
      for (const [row, value] of [[dial, chosen.polariser], [exposure, chosen.exposure], [polar, p], [azimuth, a]]) row.show(value);
      redraw();
    }

    const pointed = event => {
      const box = canvas.getBoundingClientRect();
      return [(2 * (event.clientX - box.left) / box.width - 1) * 1.02, (1 - 2 * (event.clientY - box.top) / box.height) * 1.02];
    };

    function read(event) {
      const [x, y] = pointed(event), radius = Math.hypot(x, y);
      if (!header || radius > 1) { readout.textContent = "\u00a0"; return; }
      const turn = (Math.atan2(y, x) - header.lamp[1] * Math.PI / 180 + 4 * Math.PI) % (2 * Math.PI);
      const [rows, columns] = header.shape;
      readout.textContent = fields.map((field, i) => {
        const [L, q, u, v] = between(field, header.shape, Math.asin(radius) / header.rim * (rows - 1), turn / (2 * Math.PI) * (columns - 1));
        const angle = Math.atan2(u, q) / 2 * 180 / Math.PI;
        const name = fields.length > 1 ? `${header.models[i]}: ` : "";
        if (L <= 0) return `${name}in the shadow`;
        return `${name}${written(L)} sr⁻¹, DoLP ${written(100 * Math.hypot(q, u))} %, AoLP ${written(Number(angle.toFixed(1)))}°, V/I ${written(100 * v)} %`;
      }).join("; ");
    }

    const onDisc = ([x, y]) => settings().mode === "polariser" && Math.hypot(x - DISC.x, y - DISC.y) < DISC.radius;
    const turn = ([x, y], dragging) => {
      const angle = Math.atan2(y - DISC.y, x - DISC.x) * 180 / Math.PI;
      show("polariser", Number(((angle + 360) % 180).toFixed(1)), dragging);
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
      const polar = 2 * Math.asin(Math.min(Math.hypot(x, y), 1)) * 180 / Math.PI, around = Math.atan2(y, x) * 180 / Math.PI;
      light({ polar: Number(polar.toFixed(1)), azimuth: Number(((around + 360) % 360).toFixed(1)) }, true);
    });
    canvas.addEventListener("pointerup", drop);
    canvas.addEventListener("pointercancel", drop);
    canvas.addEventListener("pointerleave", event => { if (!grip) { readout.textContent = "\u00a0"; drop(event); } });
    readout.textContent = "\u00a0";
    keepSharp(canvas, redraw);
    app.on("state", update);
    return {
      show(content, buffers) {
        header = content;
        fields = buffers.slice(0, -1);
        readout.classList.toggle("two", fields.length > 1);
        const last = buffers.at(-1);
        polarisers = new Float32Array(last.buffer.slice(last.byteOffset, last.byteOffset + last.byteLength));
        graphics.field("field", fields[0], ...header.shape);
        graphics.field("other", fields.at(-1), ...header.shape);
        update();
      },
    };
  },
});
