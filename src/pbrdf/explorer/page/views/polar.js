// Polar surfaces that are turned with pointer or arrow keys: the active model as a surface, the others as nets.

const SURFACE_VERTEX = `#version 300 es
precision highp float;
uniform sampler2D field;
uniform mat3 eye;
uniform ivec2 grid;
uniform vec2 zoom, middle, size;
uniform float rim, width;
uniform bool halved, mirrored;
uniform int kind;
in vec3 start, end;
out vec3 place;
out float shade;
const float PI = 3.14159265;

vec4 projected(vec3 p) {
  vec3 q = eye * p;
  return vec4((q.xy - middle) * zoom, -0.4 * q.z, 1.0);
}

void main() {
  if (kind == 2) {
    // a stroke as two triangles, as wide everywhere on the screen
    vec4 a = projected(start), b = projected(end);
    int corner = gl_VertexID % 6;
    bool far = corner == 1 || corner == 2 || corner == 4;
    float side = corner == 0 || corner == 1 || corner == 3 ? 1.0 : -1.0;
    vec2 along = (b.xy - a.xy) * size;
    vec2 across = length(along) > 0.0 ? normalize(vec2(-along.y, along.x)) : vec2(0.0);
    gl_Position = far ? b : a;
    gl_Position.xy += side * width * across / size;
    place = vec3(0.0);
    shade = 0.0;
    return;
  }
  int row = gl_VertexID / grid.x, column = gl_VertexID % grid.x;
  float zenith = rim * float(row) / float(grid.y - 1), turn = 2.0 * PI * float(column) / float(grid.x - 1);
  bool beyond = halved && 2 * column >= grid.x;
  ivec2 cell = ivec2(beyond ? grid.x - 1 - column : column, row);
  vec4 s = texelFetch(field, cell, 0);
  place = s.x * vec3(sin(zenith) * cos(turn), sin(zenith) * sin(turn), cos(zenith));
  shade = beyond && mirrored ? 1.0 - s.y : s.y;
  gl_Position = projected(place);
  // the net lies on the surface of another model, or on its own
  if (kind == 1) gl_Position.z -= 0.001;
}`;

const SURFACE = `#version 300 es
precision highp float;
precision highp int;
uniform sampler2D table;
uniform mat3 eye;
uniform vec4 ink;
uniform int kind;
in vec3 place;
in float shade;
out vec4 colour;
void main() {
  if (kind != 0) { colour = ink; return; }
  vec3 across = cross(dFdx(place), dFdy(place));
  float length2 = dot(across, across);
  // lit from above the beholder's left shoulder
  float facing = length2 > 0.0 ? abs(dot(eye * across * inversesqrt(length2), normalize(vec3(-0.4, 0.5, 0.8)))) : 1.0;
  colour = vec4(texture(table, vec2((255.0 * shade + 0.5) / 256.0, 0.5)).rgb * (0.6 + 0.4 * facing), 1.0);
}`;

const QUANTITY_TITLES = { intensity: "Intensity", dolp: "DoLP", aolp: "AoLP", q: "Q/I", u: "U/I", v: "V/I" };
const quantityTitle = name => QUANTITY_TITLES[name] ?? `M${name[1]}${name[2]}`;
const rgbOf = hex => [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16) / 255);

// Whether there is no graphics card.
let processorDraws = null;
function drawnByProcessor() {
  if (processorDraws === null) {
    const gl = document.createElement("canvas").getContext("webgl2");
    const name = gl?.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl?.RENDERER;
    processorDraws = /swiftshader|llvmpipe|software|basic render/i.test(gl?.getParameter(name) ?? "");
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
  }
  return processorDraws;
}

VIEWS.push({
  name: "polar",
  title: "Polar surface",
  build(place, app) {
    const label = "Polar surface; the arrow keys turn it, Home turns it back";
    const canvas = element("canvas", { width: 600, height: 450, tabindex: 0, role: "application", "aria-label": label,
      "aria-roledescription": "turnable picture" });
    const words = element("canvas", { width: 600, height: 450, "aria-hidden": "true" });
    const frame = element("div", { class: "turnable" }, canvas, words);
    // the first to ask decides; where the processor draws, smooth edges would take most of its time
    canvas.getContext("webgl2", { antialias: !drawnByProcessor(), preserveDrawingBuffer: true });
    const graphics = new Graphics(canvas, SURFACE, SURFACE_VERTEX), gl = graphics.gl;
    const tables = Object.fromEntries(Object.entries(app.catalogue.colours).map(([name, text]) =>
      [name, decoded(text)]));
    let header = null, fields = [], surface = null, net = null, meshed = "", values = null;

    const settings = () => ({ quantity: "intensity", scale: header?.scale ?? "linear", turn: header?.eye[0] ?? 0,
      tilt: header?.eye[1] ?? 0, ...app.state?.settings.polar });
    const set = (values, { dragging = false, views = [] } = {}) => app.change(state => {
      state.settings.polar = { ...state.settings.polar, ...values };
    }, { dragging, views });
    const named = names => names.map(name => [name, quantityTitle(name)]), known = app.catalogue.quantities;
    const quantity = selectField("Distance from the origin",
      [[null, named(known.filter(name => name in QUANTITY_TITLES))],
      ["Mueller elements", named(known.filter(name => !(name in QUANTITY_TITLES)))]],
      value => set({ quantity: value }, { views: ["polar"] }), { name: "polar-quantity" });
    const scales = [{ value: "linear", text: "linear" }, { value: "logarithmic", text: "log", title: "logarithmic" }];
    const scale = choiceRow("Scale", scales, value => set({ scale: value }, { views: ["polar"] }));
    quantity.node.dataset.place = "settings.polar.quantity";
    scale.node.dataset.place = "settings.polar.scale";
    const legend = new ColourLegend();
    const models = element("p", { class: "models" });
    const readout = element("p", { class: "read" }, "\u00a0");
    place.append(element("div", { class: "above" }, quantity.node, scale.node), frame, legend.node, readout, models);

    // Indices of the triangles, and of the lines of a coarse net.
    function mesh(rows, columns) {
      if (meshed === `${rows} ${columns}`) return;
      meshed = `${rows} ${columns}`;
      const triangles = [], lines = [], at = (row, column) => row * columns + column;
      for (let row = 0; row + 1 < rows; row++) for (let column = 0; column + 1 < columns; column++) {
        const a = at(row, column), b = a + 1, c = a + columns, d = c + 1;
        triangles.push(a, c, b, b, c, d);
        if (row % 5 === 0 || row + 1 === rows) lines.push(a, b);
        if (column % 10 === 0) lines.push(a, c);
      }
      for (let column = 0; column + 1 < columns; column++) lines.push(at(rows - 1, column), at(rows - 1, column + 1));
      const upload = indices => {
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(indices), gl.STATIC_DRAW);
        return { buffer, count: indices.length };
      };
      for (const old of [surface, net]) if (old) gl.deleteBuffer(old.buffer);
      surface = upload(triangles);
      net = upload(lines);
    }

    // The plane below with its azimuths, the light and its mirror direction: lists of points, width, colour.
    function scenery(theta) {
      const dark = app.theme === "dark";
      const ground = dark ? [0.4, 0.4, 0.42, 1] : [0.72, 0.72, 0.74, 1];
      const red = dark ? [1, 0.5, 0.35, 1] : [0.75, 0.2, 0, 1];
      const circle = radius => Array.from({ length: 73 }, (_, i) =>
        [radius * Math.cos(i * Math.PI / 36), radius * Math.sin(i * Math.PI / 36), 0]);
      const source = [-Math.sin(theta), 0, Math.cos(theta)], mirror = [Math.sin(theta), 0, Math.cos(theta)];
      const along = (vector, length) => vector.map(c => c * length);
      const tip = along(source, 0.75), back = along(source, 0.85),
        aside = [Math.cos(theta) * 0.04, 0, Math.sin(theta) * 0.04];
      const found = [{ points: circle(0.5), width: 1, ink: ground }, { points: circle(1), width: 1, ink: ground }];
      for (let k = 0; k < 8; k++) {
        const end = [Math.cos(k * Math.PI / 4), Math.sin(k * Math.PI / 4), 0];
        found.push({ points: [[0, 0, 0], end], width: 1, ink: ground });
      }
      found.push({ points: [[0, 0, 0], [0, 0, 1.1]], width: 1, ink: ground });
      found.push({ points: [along(source, 1.2), tip], width: 2, ink: red });
      for (const side of [1, -1]) {
        found.push({ points: [tip, back.map((c, i) => c + side * aside[i])], width: 2, ink: red });
      }
      for (const side of [0.04, -0.04]) found.push({ points: [tip, [back[0], side, back[2]]], width: 2, ink: red });
      for (let k = 0; k < 12; k++) {
        found.push({ points: [along(mirror, k / 10), along(mirror, (k + 0.5) / 10)], width: 1.5, ink: red });
      }
      const ink = dark ? "#d8d8dc" : "#333336", signal = dark ? "#ff9a80" : "#a63000";
      const labels = [
        [[1.17, 0, 0], "forward 0°", ink], [[0, 1.17, 0], "90°", ink], [[-1.17, 0, 0], "back 180°", ink],
          [[0, -1.17, 0], "−90°", ink],
        [[0, 0, 1.17], "normal", ink], [along(source, 1.28), "light", signal], [along(mirror, 1.28), "mirror", signal],
      ];
      return { lines: found, labels };
    }

    // The eye's axes as rows: to the right, upwards, towards the eye.
    function axes() {
      const { turn, tilt } = settings(), a = turn * Math.PI / 180, e = tilt * Math.PI / 180;
      return [[-Math.sin(a), Math.cos(a), 0], [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)],
        [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)]];
    }
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

    // From places of the surface to the canvas: zoom and what stands in its middle.
    function projection() {
      const tilt = settings().tilt * Math.PI / 180, low = -1.2 * Math.abs(Math.sin(tilt)),
        high = Math.max(1.25 * Math.cos(tilt), -low);
      const zoom = Math.min(1 / 1.4, canvas.height / canvas.width / ((high - low) / 2 + 0.06));
      return { zoom: [zoom, zoom * canvas.width / canvas.height], middle: [0, (high + low) / 2] };
    }

    const strokes = gl.createBuffer(), slots = ["start", "end"].map(name =>
      gl.getAttribLocation(graphics.program, name));
    function stroke(lines) {
      const corners = [], groups = [];
      for (const { points, width, ink } of lines) {
        for (let i = 0; i + 1 < points.length; i++) {
          for (let k = 0; k < 6; k++) corners.push(...points[i], ...points[i + 1]);
        }
        // a call for all that look alike: where the processor draws, calls are dear
        const before = groups.at(-1);
        if (before?.width !== width || before.ink !== ink) groups.push({ width, ink, first: before?.end ?? 0 });
        groups.at(-1).end = corners.length / 6;
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, strokes);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STREAM_DRAW);
      slots.forEach((slot, i) => {
        gl.enableVertexAttribArray(slot);
        gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, 12 * i);
      });
      for (const { width, ink, first, end } of groups) {
        graphics.vector("ink", ink);
        graphics.number("width", width * (window.devicePixelRatio || 1));
        gl.drawArrays(gl.TRIANGLES, first, end - first);
      }
      slots.forEach(slot => gl.disableVertexAttribArray(slot));
    }

    function redraw() {
      if (!header) return;
      const [rows, some] = header.shape, columns = header.halved ? 2 * some - 1 : some;
      mesh(rows, columns);
      const eye = axes(), { zoom, middle } = projection();
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.uniformMatrix3fv(graphics.place("eye"), true, eye.flat());
      gl.uniform2i(graphics.place("grid"), columns, rows);
      graphics.vector("zoom", zoom);
      graphics.vector("middle", middle);
      graphics.vector("size", [canvas.width, canvas.height]);
      graphics.number("rim", header.rim);
      graphics.integer("halved", header.halved ? 1 : 0);
      graphics.integer("mirrored", header.mirrored ? 1 : 0);
      graphics.colours("table", tables[header.colours]);
      fields.forEach((field, i) => {
        graphics.field("field", field, rows, some);
        graphics.integer("kind", i ? 1 : 0);
        if (i) graphics.vector("ink", [...rgbOf(app.catalogue.looks[header.layers[i]].colour), 1]);
        const { buffer, count } = i ? net : surface;
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
        gl.drawElements(i ? gl.LINES : gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      });
      graphics.integer("kind", 2);
      const { lines, labels } = scenery(header.theta_i * Math.PI / 180);
      stroke(lines);
      letter(labels, eye, zoom, middle);
      tell();
    }

    function letter(labels, eye, zoom, middle) {
      words.width = canvas.width;
      words.height = canvas.height;
      const pen = words.getContext("2d"), ratio = canvas.width / Math.max(canvas.clientWidth, 1);
      pen.font = `${12 * ratio}px system-ui, sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      for (const [point, text, ink] of labels) {
        const [x, y] = onCanvas(point, eye, zoom, middle), half = pen.measureText(text).width / 2 + 2 * ratio;
        pen.fillStyle = ink;
        pen.fillText(text, Math.min(Math.max(x, half), canvas.width - half),
          Math.min(Math.max(y, 8 * ratio), canvas.height - 8 * ratio));
      }
    }
    const onCanvas = (point, eye, zoom, middle) => [
      (1 + (dot(eye[0], point) - middle[0]) * zoom[0]) * canvas.width / 2,
      (1 - (dot(eye[1], point) - middle[1]) * zoom[1]) * canvas.height / 2,
    ];

    function tell() {
      const signed = header.colours === "signed", angle = header.colours === "cyclic", { most } = header;
      const logarithmic = header.scale === "logarithmic" && !angle;
      const low = signed || angle ? -most : logarithmic ? most * 10 ** -header.decades : 0;
      const title = logarithmic ? `${header.title}, ${header.decades} decades` : header.title;
      legend.show(tables[header.colours], [low, most], "", title);
      models.replaceChildren(...header.layers.flatMap((layer, i) => [
        i ? swatch({ ...app.catalogue.looks[layer], dash: [] }) : "",
          `${i ? " net" : "surface"}: ${app.state.layers[layer]?.name ?? ""} `,
      ]));
    }

    function update() {
      const chosen = settings();
      quantity.select.value = chosen.quantity;
      scale.show(chosen.scale);
      scale.node.classList.toggle("idle", chosen.quantity === "aolp");
      redraw();
    }

    // The direction whose point of the active surface is seen under the pointer, the nearest of those in front.
    function read(event) {
      if (!header) return;
      const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
      const x = (event.clientX - box.left) * ratio, y = (event.clientY - box.top) * ratio;
      const [rows, some] = header.shape, columns = header.halved ? 2 * some - 1 : some;
      if (!values) {
        values = Float32Array.from({ length: rows * some * 4 }, (_, i) => halfNumber(fields[0].getUint16(2 * i, true)));
      }
      const eye = axes(), { zoom, middle } = projection(), reach = 6 * ratio;
      let best = null;
      for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
        const beyond = header.halved && 2 * column >= columns,
          cell = 4 * (row * some + (beyond ? columns - 1 - column : column));
        const zenith = header.rim * row / (rows - 1), turn = 2 * Math.PI * column / (columns - 1), r = values[cell];
        const point = [r * Math.sin(zenith) * Math.cos(turn), r * Math.sin(zenith) * Math.sin(turn),
          r * Math.cos(zenith)];
        const [px, py] = onCanvas(point, eye, zoom, middle), away = Math.hypot(px - x, py - y),
          near = dot(eye[2], point);
        if (away > reach || (best && near - away / canvas.width < best.near)) continue;
        best = { near: near - away / canvas.width, zenith, turn, share: values[cell + 2], beyond };
      }
      if (!best) { readout.textContent = "\u00a0"; return; }
      const odd = best.beyond && header.mirrored;
      const share = odd ? -best.share : best.share, azimuth = best.turn > Math.PI ? best.turn - 2 * Math.PI : best.turn;
      const degrees = a => `${Math.round(a * 180 / Math.PI)}°`.replace("-", "−");
      const value = written(share * header.most);
      readout.textContent = `θr ${degrees(best.zenith)}, φ ${degrees(azimuth)}: ${header.title} ${value}`;
    }

    const turned = (turn, tilt, dragging) => set({
      turn: Math.round(((turn + 540) % 360 - 180) * 10) / 10,
        tilt: Math.round(Math.min(Math.max(tilt, -20), 90) * 10) / 10,
    }, { dragging });
    let grip = null;
    canvas.addEventListener("pointerdown", event => {
      if (event.button) return;
      canvas.setPointerCapture(event.pointerId);
      const { turn, tilt } = settings();
      grip = { x: event.clientX, y: event.clientY, turn, tilt, moved: false };
    });
    canvas.addEventListener("pointermove", event => {
      if (!grip) { read(event); return; }
      grip.moved = true;
      turned(grip.turn - (event.clientX - grip.x) * 0.5, grip.tilt + (event.clientY - grip.y) * 0.5, true);
    });
    const drop = () => { if (grip?.moved) set({}); grip = null; };
    canvas.addEventListener("pointerup", drop);
    canvas.addEventListener("pointercancel", drop);
    canvas.addEventListener("pointerleave", () => { if (!grip) readout.textContent = "\u00a0"; });
    canvas.addEventListener("keydown", event => {
      const { turn, tilt } = settings();
      const step = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
      if (step) turned(turn + step[0], tilt + step[1], false);
      else if (event.key === "Home" && header) turned(...header.eye, false);
      else return;
      event.preventDefault();
    });
    keepSharp(canvas, redraw);
    // a moved slider has its picture to come; what stands is drawn again where the settings or the names are others
    let followed = "";
    app.on("state", () => {
      const now = JSON.stringify([settings(), app.state.layers.map(layer => layer.name)]);
      if (now !== followed) update();
      followed = now;
    });
    app.on("theme", redraw);
    return {
      show(content, buffers) {
        header = content;
        fields = buffers;
        values = null;
        update();
      },
    };
  },
});
