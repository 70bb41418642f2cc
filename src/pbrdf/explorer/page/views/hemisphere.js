// Fields over the hemisphere of viewing directions: the zenith in the middle, the forward half-plane to the right.

const HEMISPHERE = `#version 300 es
precision highp float;
in vec2 at;
uniform sampler2D field, table;
uniform vec4 mirror;
uniform vec2 range;
uniform int channel;
out vec4 colour;
const float PI = 3.14159265;
void main() {
  vec2 w = (at - 0.5) * 2.04;
  float zenith = length(w);
  if (zenith > 1.0) { colour = vec4(0.0); return; }
  float azimuth = atan(w.y, w.x);
  vec2 size = vec2(textureSize(field, 0));
  vec2 cell = vec2(abs(azimuth) / PI, zenith) * (size - 1.0) + 0.5;
  vec4 s = texture(field, cell / size);
  if (azimuth < 0.0) s *= mirror;
  float value = channel == 0 ? s.r : channel == 1 ? length(s.gb) : s.g;
  colour = vec4(texture(table, vec2((value - range.x) / (range.y - range.x), 0.5)).rgb, 1.0);
}`;

VIEWS.push({
  name: "hemisphere",
  title: "Hemisphere",
  build(place, app) {
    const canvas = element("canvas", { width: 450, height: 450, role: "img", "aria-label": "Intensity over the hemisphere" });
    place.append(canvas);
    const graphics = new Graphics(canvas, HEMISPHERE);
    const tables = app.catalogue.colours;
    graphics.colours("table", decoded(tables.sequential));
    return {
      show(header, [buffer]) {
        const [rows, columns] = header.shape;
        graphics.field("field", buffer, rows, columns);
        graphics.vector("mirror", header.mirror);
        graphics.vector("range", [-3, 1]);
        graphics.integer("channel", 0);
        graphics.gl.viewport(0, 0, canvas.width, canvas.height);
        graphics.gl.drawArrays(graphics.gl.TRIANGLES, 0, 3);
      },
    };
  },
});
