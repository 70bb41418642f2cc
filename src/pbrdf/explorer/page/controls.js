// Controls that the panels share. A control stands in an element with `data-place`, the path of what it sets in the
// state: an error about that path is shown there.

// Steps along a slider.
const STEPS = 1000;

// k_s as it is printed.
const subscripted = symbol => symbol.split("_").map((part, i) => i ? element("sub", {}, part) : part);

// What an error says of a control, empty while there is none.
function faultBelow(input) {
  const fault = element("p", { class: "fault", id: freshId("fault") });
  input.setAttribute("aria-describedby", [input.getAttribute("aria-describedby"), fault.id].filter(Boolean).join(" "));
  return fault;
}

// A number that is dragged or typed. `scale` has symbol, about, unit, lower and upper (of the slider), least and most
// (of what can be typed, null for no limit), logarithmic, name. `set(value, dragging)` is told of changes, `home()`
// gives the value to go back to, or null.
function sliderRow(scale, set, home = () => null) {
  const { lower, upper, least, most, logarithmic } = scale;
  const along = value => logarithmic ? Math.log(value / lower) / Math.log(upper / lower) : (value - lower) / (upper - lower);
  const digits = Math.max(0, Math.ceil(-Math.log10((upper - lower) / STEPS)));
  const valueAt = step => {
    const t = step / STEPS;
    if (t <= 0) return lower;
    if (t >= 1) return upper;
    return logarithmic ? Number((lower * (upper / lower) ** t).toPrecision(4)) : Number((lower + (upper - lower) * t).toFixed(digits));
  };
  let shown = lower;
  const unit = scale.unit && scale.unit !== "1" ? scale.unit : "";
  const about = element("span", { class: "about", id: freshId("about") }, scale.about);
  const slider = element("input", {
    type: "range", min: 0, max: STEPS, step: 1, name: scale.name, "aria-label": scale.symbol, "aria-describedby": about.id,
    oninput: () => set(valueAt(Number(slider.value)), true),
    onchange: () => set(valueAt(Number(slider.value)), false),
  });
  const typed = element("input", {
    type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", class: "number",
    "aria-label": `${scale.symbol}, number`, "aria-describedby": about.id,
    onchange: () => {
      const value = understood(typed.value);
      const limits = `${least === null ? "−∞" : written(least)} … ${most === null ? "∞" : written(most)}`;
      if (!Number.isFinite(value)) complain(`“${typed.value}” is not a number`);
      else if ((least !== null && value < least) || (most !== null && value > most)) complain(`${scale.symbol} is within ${limits}`);
      else { complain(""); set(value, false); show(value); }
    },
    onkeydown: event => {
      if (event.key === "Escape") { complain(""); typed.value = String(shown); }
      const turn = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!turn) return;
      event.preventDefault();
      set(valueAt(Math.round(along(shown) * STEPS) + turn), false);
    },
    onfocus: () => typed.select(),
  });
  const fault = faultBelow(typed);
  const complain = text => { fault.textContent = text; typed.setAttribute("aria-invalid", text !== ""); };
  const back = iconButton("reset", `Reset ${scale.symbol}`, () => set(home(), false));
  const beyond = element("span", { class: "beyond" });
  const node = element("div", { class: "slider-row" },
    element("div", { class: "named" }, element("span", { class: "symbol", "aria-hidden": "true" }, subscripted(scale.symbol)), about),
    element("div", { class: "typed" }, typed, element("span", { class: "unit" }, unit)),
    element("div", { class: "track" }, element("span", { class: "bound" }, written(lower)), slider, element("span", { class: "bound" }, written(upper)), back),
    beyond, fault);
  function show(value) {
    if (shown === value && slider.getAttribute("aria-valuetext") !== null) { offerHome(); return; }
    shown = value;
    const step = Math.round(Math.min(Math.max(along(value), 0), 1) * STEPS);
    slider.value = Number.isFinite(step) ? step : 0;
    // how far the track is filled is CSS's to draw
    slider.style.setProperty("--filled", `${slider.value / STEPS * 100}%`);
    slider.setAttribute("aria-valuetext", `${written(value, 4)} ${unit}`.trim());
    if (typed.getRootNode().activeElement !== typed || understood(typed.value) !== value) typed.value = written(value, 6);
    complain("");
    const outside = value < lower || value > upper;
    beyond.textContent = outside ? `beyond the bounds of fits, ${written(lower)} … ${written(upper)}` : "";
    offerHome();
  }
  function offerHome() {
    const to = home();
    back.disabled = to === null || to === shown;
    if (to !== null) relabel(back, "reset", `Reset ${scale.symbol} to ${written(to, 4)}`);
  }
  return { node, show, slider, typed };
}

// One of a few choices, each {value, text, title}.
function choiceRow(label, choices, set) {
  const name = freshId("choice");
  const inputs = new Map();
  const node = element("fieldset", { class: "choices" }, element("legend", { class: "unseen" }, label), choices.map(choice => {
    const input = element("input", { type: "radio", name, value: choice.value, onchange: () => set(choice.value) });
    inputs.set(choice.value, input);
    return element("label", { title: choice.title }, input, element("span", {}, choice.text));
  }));
  return { node, show: value => { for (const [key, input] of inputs) input.checked = key === value; } };
}

// One of many choices; `groups` are [label, [[value, text, title], …]], a group without a label stands bare.
function selectField(label, groups, onchange, attributes = {}) {
  const id = freshId("select");
  const options = entries => entries.map(([value, text, title]) => element("option", { value, title }, text));
  const select = element("select", { id, onchange: () => onchange(select.value), ...attributes },
    groups.map(([name, entries]) => name ? element("optgroup", { label: name }, options(entries)) : options(entries)));
  return { node: element("div", { class: "field" }, element("label", { for: id }, label), select), select };
}

// A choice that is acted on by a button: arrow keys walk through the choices of a closed select.
function selectAndDo(label, groups, verb, act) {
  const field = selectField(label, groups, () => { button.disabled = !field.select.value; });
  const button = element("button", { type: "button", disabled: true, onclick: () => {
    act(field.select.value);
    field.select.value = "";
    button.disabled = true;
    // the button that has the focus is no place to stay when it is disabled
    field.select.focus();
  } }, verb);
  return { node: element("div", { class: "select-and-do" }, field.node, button), select: field.select };
}

// The line and the marker of a layer, as the curves draw them.
function swatch(look) {
  return drawn("svg", { viewBox: "0 0 34 14", class: "swatch", "aria-hidden": "true" },
    drawn("line", { x1: 1, x2: 33, y1: 7, y2: 7, stroke: look.colour, "stroke-width": 2.5, "stroke-dasharray": look.dash.join(" ") }),
    drawn("path", { d: MARKERS[look.marker] ?? MARKERS.o, fill: look.colour, transform: "translate(17 7) scale(4.2)" }));
}

// Matplotlib's markers within a circle of radius 1.
const MARKERS = {
  o: "M1 0A1 1 0 1 1-1 0 1 1 0 1 1 1 0z",
  s: "M-.9-.9H.9V.9H-.9z",
  "^": "M0-1.1 1.1.9H-1.1z",
  D: "M0-1.2 1.2 0 0 1.2-1.2 0z",
  v: "M0 1.1 1.1-.9H-1.1z",
  "<": "M-1.1 0 .9-1.1V1.1z",
};
