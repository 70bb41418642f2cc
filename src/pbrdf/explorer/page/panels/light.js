// The incident light: its direction and its Stokes vector, in the (p, s) frame.

const TURN = Math.PI / 180;
const KINDS = [
  { value: "natural", text: "natural", title: "unpolarised light" },
  { value: "linear", text: "linear", title: "linearly polarised at an angle, wholly or partly" },
  { value: "circular", text: "circular", title: "circularly polarised, wholly or partly" },
  { value: "numbers", text: "I Q U V", title: "any Stokes vector, as four numbers" },
];

PANELS.push({
  name: "light",
  title: "Light",
  build(place, app) {
    const scale = (name, symbol, about, unit, lower, upper, most = upper) => ({ name, symbol, about, unit, lower, upper, least: lower, most, logarithmic: false });
    const theta = sliderRow(scale("theta_i", "θᵢ", "angle of incidence, from the normal", "°", 0, 85, 90),
      (value, dragging) => app.change(state => { state.light.theta_i = value; }, { dragging }), () => 35);
    theta.node.dataset.place = "light.theta_i";
    // what the controls say; kept while a Stokes vector cannot tell it, as the angle of natural light
    let kind = "natural", angle = 0, degree = 1, hand = 1;
    const tell = dragging => app.change(state => {
      if (kind === "natural") state.light.stokes = [1, 0, 0, 0];
      if (kind === "linear") state.light.stokes = [1, tidy(degree * Math.cos(2 * angle * TURN)), tidy(degree * Math.sin(2 * angle * TURN)), 0];
      if (kind === "circular") state.light.stokes = [1, 0, 0, hand * degree];
    }, { dragging });
    const tidy = value => Number(value.toFixed(12));
    const kinds = choiceRow("Polarisation of the light", KINDS, value => { kind = value; tell(false); });
    const angles = sliderRow(scale("light_angle", "α", "plane of polarisation, 0° for p and 90° for s", "°", 0, 180), (value, dragging) => { angle = value; tell(dragging); });
    const degrees = sliderRow(scale("light_degree", "P", "degree of polarisation", "1", 0, 1), (value, dragging) => { degree = value; tell(dragging); });
    const hands = choiceRow("Sense of rotation", [
      { value: "1", text: "left (V > 0)", title: "anticlockwise for the receiver" },
      { value: "-1", text: "right (V < 0)", title: "clockwise for the receiver" },
    ], value => { hand = Number(value); tell(false); });
    const numbers = ["I", "Q", "U", "V"].map((name, i) => element("input", {
      type: "text", inputmode: "decimal", class: "number", autocomplete: "off", "aria-label": `${name} of the light`,
      onchange: event => app.change(state => { state.light.stokes[i] = understood(event.target.value); }),
    }));
    const four = element("div", { class: "four" }, ...["I", "Q", "U", "V"].map((name, i) => element("label", {}, element("span", { class: "symbol" }, name), numbers[i])));
    const fault = element("p", { class: "fault", id: freshId("fault") });
    numbers.forEach(input => input.setAttribute("aria-describedby", fault.id));
    const body = element("div", { class: "light", "data-place": "light.stokes" }, kinds.node, element("div", { class: "of-kind" }, angles.node, hands.node, degrees.node, four), fault);
    place.append(theta.node, body);
    return {
      update(state) {
        theta.show(state.light.theta_i);
        const [I, Q, U, V] = state.light.stokes;
        const linear = Math.hypot(Q, U) / I, whole = Math.hypot(Q, U, V) / I;
        const found = whole === 0 ? "natural" : V === 0 ? "linear" : linear === 0 ? "circular" : "numbers";
        // a degree of 0 is natural light, and four numbers can be of any kind
        if (kind !== "numbers" && found !== kind && found !== "natural") kind = found;
        if (found === "natural" && I > 0 && kind !== "numbers" && degree !== 0) kind = "natural";
        if (kind === "linear" && found === "linear") {
          degree = tidy(Math.min(linear, 1));
          const of = Math.atan2(U, Q) / TURN / 2;
          if (Math.abs(Math.sin((of - angle) * TURN)) > 1e-9) angle = tidy((of + 180) % 180);
        }
        if (kind === "circular" && found === "circular") { degree = Math.abs(V) / I; hand = Math.sign(V); }
        kinds.show(kind);
        angles.node.hidden = kind !== "linear";
        hands.node.hidden = kind !== "circular";
        degrees.node.hidden = kind !== "linear" && kind !== "circular";
        four.hidden = kind !== "numbers";
        angles.show(angle);
        degrees.show(degree);
        hands.show(String(hand));
        numbers.forEach((input, i) => { input.value = Number.isFinite(state.light.stokes[i]) ? written(state.light.stokes[i], 6) : ""; });
      },
    };
  },
});
