// WebGL2: fields as float16 textures, colour tables, one program a view. No physics: fields come computed.

class Graphics {
  constructor(canvas, fragment, vertex = WHOLE_CANVAS) {
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

const WHOLE_CANVAS = `#version 300 es
out vec2 at;
void main() { vec2 corner = vec2(gl_VertexID % 2, gl_VertexID / 2); at = 2.0 * corner; gl_Position = vec4(4.0 * corner - 1.0, 0.0, 1.0); }`;

const decoded = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
