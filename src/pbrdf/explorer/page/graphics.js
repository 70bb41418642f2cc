// WebGL2: fields as float16 textures, colour tables, one program a view. No physics: fields come computed.

class Graphics {
  constructor(canvas, fragment, vertex) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL2, which the pictures need");
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    this.textures = new Map();
    this.places = new Map();
  }

  place(name) {
    if (!this.places.has(name)) this.places.set(name, this.gl.getUniformLocation(this.program, name));
    return this.places.get(name);
  }

  // Bind the texture of a sampler, made at its first use.
  texture(name) {
    const gl = this.gl;
    if (!this.textures.has(name)) {
      this.textures.set(name, { unit: this.textures.size, texture: gl.createTexture() });
      const { unit, texture } = this.textures.get(name);
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
      for (const way of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, way, gl.CLAMP_TO_EDGE);
      gl.uniform1i(this.place(name), unit);
    }
    gl.activeTexture(gl.TEXTURE0 + this.textures.get(name).unit);
  }

  // A field of shape (rows, columns, 4) of float16 values.
  field(name, buffer, rows, columns) {
    const gl = this.gl;
    this.texture(name);
    const values = new Uint16Array(buffer.buffer.slice(buffer.byteOffset, buffer.byteOffset + buffer.byteLength));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, columns, rows, 0, gl.RGBA, gl.HALF_FLOAT, values);
  }

  // A colour table of 256 entries of four bytes.
  colours(name, bytes) {
    const gl = this.gl;
    this.texture(name);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  }

  number(name, value) { this.gl.uniform1f(this.place(name), value); }
  integer(name, value) { this.gl.uniform1i(this.place(name), value); }
  vector(name, values) { this.gl[`uniform${values.length}fv`](this.place(name), values); }
}

const decoded = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));

// A float16 number, given as its 16 bits.
function halfNumber(bits) {
  const sign = bits & 0x8000 ? -1 : 1, exponent = bits >> 10 & 31, fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : fraction * 2 ** -24);
}
let halfNumbers = null;
function allHalfNumbers() {
  if (halfNumbers) return halfNumbers;
  halfNumbers = new Float32Array(65536);
  for (let exponent = 0; exponent < 65536; exponent += 1024) {
    const first = halfNumber(exponent), step = halfNumber(exponent + 1) - first;
    for (let fraction = 0; fraction < 1024; fraction++) halfNumbers[exponent + fraction] = first + fraction * step;
  }
  return halfNumbers;
}

// Fields over hemispheres are painted here and not in a shader: for a picture of 450 by 450 pixels that takes a
// millisecond on any machine, less than to send it to the graphics and to wait for them.

// Hemispheres have the zenith in the middle, the forward half-plane to the right and azimuths anticlockwise; this much
// of a square's half side, in radii, is shown around them.
const HEMISPHERE_REACH = 1.16;
// Steps of a range of colours, a power of two: interpolation is in whole numbers.
const LEVELS = 4096;

const hemisphereMaps = new Map();

// Where each pixel of a square's upper half lies between the directions of a grid, for all pictures of that size.
function hemisphereMap(size, rows, columns) {
  const key = [size, rows, columns].join();
  if (hemisphereMaps.has(key)) return hemisphereMaps.get(key);
  if (hemisphereMaps.size > 8) hemisphereMaps.clear();
  const half = Math.ceil(size / 2), most = size * half;
  const map = { above: new Uint32Array(most), below: new Uint32Array(most), corner: new Uint32Array(most), weights: new Uint16Array(most), rim: [] };
  const scale = 2 * HEMISPHERE_REACH / size;
  let count = 0;
  for (let j = 0; j < half; j++) {
    const y = (size / 2 - j - 0.5) * scale;
    for (let i = 0; i < size; i++) {
      const x = (i + 0.5 - size / 2) * scale, zenith = Math.hypot(x, y), cover = (1 - zenith) / scale + 0.5;
      if (cover <= 0) continue;
      const r = Math.min(zenith, 1) * (rows - 1), c = Math.atan2(y, x) / Math.PI * (columns - 1);
      const r0 = Math.min(Math.floor(r), rows - 2), c0 = Math.min(Math.floor(c), columns - 2);
      map.above[count] = j * size + i;
      map.below[count] = (size - 1 - j) * size + i;
      map.corner[count] = r0 * columns + c0;
      map.weights[count] = Math.round((r - r0) * 255) << 8 | Math.round((c - c0) * 255);
      if (cover < 1) map.rim.push(count, Math.round(cover * 255));
      count++;
    }
  }
  for (const name of ["above", "below", "corner", "weights"]) map[name] = map[name].slice(0, count);
  hemisphereMaps.set(key, map);
  return map;
}

// A colour table in LEVELS steps, as pixels.
const levelTables = new Map();
function levelTable(text) {
  if (!levelTables.has(text)) {
    const bytes = decoded(text), table = new Uint32Array(LEVELS), pixel = new DataView(table.buffer);
    for (let level = 0; level < LEVELS; level++) {
      const at = level / (LEVELS - 1) * 255, low = Math.min(Math.floor(at), 254), share = at - low;
      for (let k = 0; k < 4; k++) pixel.setUint8(4 * level + k, Math.round(bytes[4 * low + k] * (1 - share) + bytes[4 * low + 4 + k] * share));
    }
    levelTables.set(text, table);
  }
  return levelTables.get(text);
}

// Paints one picture after the other, each { plane, mirrored, sign, colours } of planes of float16 numbers; of
// angles `polarised` are the planes of DoLP for both halves.
class HemispherePainter {
  constructor(tables) {
    this.tables = tables;
    this.levels = new Map();
  }

  // Take planes of `rows` zenith angles and `columns` azimuths.
  load(buffer, [rows, columns]) {
    const even = buffer.byteOffset % 2 === 0;
    const bytes = even ? buffer : new DataView(buffer.buffer.slice(buffer.byteOffset, buffer.byteOffset + buffer.byteLength));
    this.values = new Uint16Array(bytes.buffer, bytes.byteOffset, bytes.byteLength / 2);
    this.rows = rows;
    this.columns = columns;
  }

  // Steps of the colours for all float16 numbers.
  levelsOf([low, high]) {
    const key = `${low},${high}`;
    if (!this.levels.has(key)) {
      if (this.levels.size > 40) this.levels.clear();
      const scale = (LEVELS - 1) / (high - low), numbers = allHalfNumbers(), levels = new Uint16Array(65536);
      for (let bits = 0; bits < 65536; bits++) {
        const level = (numbers[bits] - low) * scale + 0.5;
        levels[bits] = level > 0 ? level < LEVELS ? level : LEVELS - 1 : 0;
      }
      this.levels.set(key, levels);
    }
    return this.levels.get(key);
  }

  paint(canvas, picture, range) {
    const size = canvas.width, map = hemisphereMap(size, this.rows, this.columns), context = canvas.getContext("2d");
    if (canvas.image?.width !== size) canvas.image = context.createImageData(size, size);
    const pixels = new Uint32Array(canvas.image.data.buffer), table = levelTable(this.tables[picture.colours]);
    const levels = this.levelsOf(range), cyclic = picture.colours === "cyclic", length = this.rows * this.columns;
    const half = (plane, flip) => {
      const field = this.field ??= new Uint16Array(length), from = plane * length, values = this.values;
      for (let k = 0; k < length; k++) field[k] = levels[values[from + k] ^ flip];
      return field;
    };
    const same = picture.plane === picture.mirrored && picture.sign > 0;
    if (this.field?.length !== length) this.field = null;
    paintHalf(pixels, map.above, same ? map.below : map.above, map, half(picture.plane, 0), this.columns, table, cyclic);
    if (!same) {
      const field = half(picture.mirrored, picture.sign < 0 ? 0x8000 : 0);
      paintHalf(pixels, map.below, map.below, map, field, this.columns, table, cyclic);
    }
    const bytes = canvas.image.data, { rim, above, below } = map;
    picture.polarised?.forEach((plane, i) => {
      const numbers = allHalfNumbers(), strength = Float32Array.from(this.values.subarray(plane * length, (plane + 1) * length), bits => numbers[bits]);
      if (strength.some(dolp => dolp < FADED)) fadeHalf(pixels, i ? below : above, map, strength, this.columns);
    });
    for (let k = 0; k < rim.length; k += 2) for (const places of [above, below]) {
      const at = 4 * places[rim[k]] + 3;
      bytes[at] = Math.min(bytes[at], rim[k + 1]);
    }
    context.putImageData(canvas.image, 0, 0);
  }

  // Value of a picture at a direction in degrees; null where there is no angle.
  value(picture, zenith, azimuth) {
    if (picture.polarised) {
      const [plane, mirrored] = picture.polarised;
      if (angleIsNone(this.value({ plane, mirrored, sign: 1 }, zenith, azimuth))) return null;
    }
    const turn = Math.abs(((azimuth + 180) % 360 + 360) % 360 - 180), ahead = Math.sin(azimuth * Math.PI / 180) >= 0;
    const r = zenith / 90 * (this.rows - 1), c = turn / 180 * (this.columns - 1);
    const r0 = Math.min(Math.floor(r), this.rows - 2), c0 = Math.min(Math.floor(c), this.columns - 2);
    const plane = ahead ? picture.plane : picture.mirrored, sign = ahead ? 1 : picture.sign;
    const cyclic = picture.colours === "cyclic";
    const corner = (dr, dc) => sign * halfNumber(this.values[(plane * this.rows + r0 + dr) * this.columns + c0 + dc]);
    // angles are taken on from the first by the shorter way
    const first = corner(0, 0), near = v => cyclic ? v - 180 * Math.round((v - first) / 180) : v;
    const row = dr => near(corner(dr, 0)) * (1 - c + c0) + near(corner(dr, 1)) * (c - c0);
    const value = row(0) * (1 - r + r0) + row(1) * (r - r0);
    if (cyclic) return value - 180 * Math.ceil((value - 90) / 180);
    return picture.logarithmic ? 10 ** value : value;
  }
}

// How much of its colour an angle of polarisation keeps, by DoLP: noise has an angle, too.
const FADED = 0.01;
function shareOfAngle(dolp) {
  const share = Math.min(dolp / FADED, 1);
  return share * share * (3 - 2 * share);
}
// In words there is no angle below half of that.
const angleIsNone = dolp => dolp < FADED / 2;

// Let a half of a picture fade into what is behind it, by the DoLP in the directions.
function fadeHalf(pixels, places, { corner, weights }, strength, columns) {
  for (let k = 0; k < corner.length; k++) {
    const at = corner[k], wr = (weights[k] >> 8) / 255, wc = (weights[k] & 255) / 255;
    const upper = strength[at] + (strength[at + 1] - strength[at]) * wc;
    const lower = strength[at + columns] + (strength[at + columns + 1] - strength[at + columns]) * wc;
    const alpha = Math.round(255 * shareOfAngle(upper + (lower - upper) * wr));
    pixels[places[k]] = pixels[places[k]] & 0xffffff | alpha << 24;
  }
}

// Colours between the four nearest directions, into two places.
function paintHalf(pixels, places, others, { corner, weights }, field, columns, table, cyclic) {
  const count = corner.length;
  for (let k = 0; k < count; k++) {
    const at = corner[k], w = weights[k], wr = w >> 8, wc = w & 255;
    const a = field[at];
    let b = field[at + 1], c = field[at + columns], d = field[at + columns + 1];
    if (cyclic) {
      b = a + ((b - a + LEVELS / 2) & (LEVELS - 1)) - LEVELS / 2;
      c = a + ((c - a + LEVELS / 2) & (LEVELS - 1)) - LEVELS / 2;
      d = a + ((d - a + LEVELS / 2) & (LEVELS - 1)) - LEVELS / 2;
    }
    const upper = 255 * a + (b - a) * wc, lower = 255 * c + (d - c) * wc;
    const level = (255 * upper + (lower - upper) * wr) * (1 / 65025) | 0;
    pixels[places[k]] = pixels[others[k]] = table[level & (LEVELS - 1)];
  }
}

// The least of 1, 2 and 5 times a power of ten that is not below a number.
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map(m => m * power).find(x => x >= value * (1 - 1e-6));
}

// Range of colours of a picture, as its planes count. While a slider is dragged it only widens, so that colours keep
// their meaning.
function colourRange(picture, before, dragging) {
  if (picture.range) return picture.range;
  if (picture.colours === "cyclic") return [-90, 90];
  let [low, high] = picture.extent;
  if (picture.logarithmic) {
    high = Math.ceil(2 * high) / 2;
    low = Math.min(Math.max(Math.floor(2 * low) / 2, high - 4), high - 0.5);
  } else if (picture.colours === "signed") {
    high = roundAbove(Math.max(Math.abs(low), Math.abs(high), 0.001));
    low = -high;
  } else {
    low = 0;
    high = Math.min(roundAbove(Math.max(high, 0.01)), 1);
  }
  return dragging && before ? [Math.min(low, before[0]), Math.max(high, before[1])] : [low, high];
}

// A bar of colours with what its ends and its middle stand for.
function colourBar(tables) {
  const bar = element("div", { class: "bar", "aria-hidden": "true" });
  const ends = [0, 1, 2].map(() => element("span"));
  let shown = "";
  return {
    ends: [ends[0], ends[2]],
    node: element("div", { class: "colour-bar" }, bar, element("div", { class: "ends" }, ...ends)),
    show(picture, range) {
      if (shown !== picture.colours) {
        shown = picture.colours;
        const table = decoded(tables[shown]);
        const stops = Array.from({ length: 18 }, (_, i) => `rgb(${table.slice(60 * i, 60 * i + 3).join()})`);
        bar.style.background = `linear-gradient(90deg, ${stops.join()})`;
      }
      const unit = picture.colours === "cyclic" ? "°" : "";
      [range[0], (range[0] + range[1]) / 2, range[1]].forEach((value, i) => {
        const text = written(picture.logarithmic ? 10 ** value : value, 2) + unit;
        if (ends[i].textContent !== text) ends[i].textContent = text;
      });
    },
  };
}
