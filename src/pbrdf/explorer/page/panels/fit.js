// χ², which may be far from 1.
const chiSquare = value => value === null ? "–" : value < 1e6 ? written(value, 5) : value.toExponential(3).replace("e+", "e");

// The fit of the active model, from where its sliders stand.

PANELS.push({
  name: "fit",
  title: "Fit",
  build(place, app) {
    const set = edit => app.change(state => edit(state.settings.fit ??= {}), { views: [] });
    const list = element("div", { class: "list" });
    const startsId = freshId("starts");
    const starts = element("input", { type: "number", id: startsId, class: "number", min: 1, max: 256, step: 1, onchange: () => set(settings => { settings.starts = Number(starts.value); }) });
    const begin = element("button", { type: "button", class: "first", onclick: () => app.send({ type: "fit", state: app.state }) }, "Fit from here");
    const cancel = element("button", { type: "button", disabled: true, onclick: () => app.send({ type: "cancel_fit" }) }, "Cancel");
    const bar = element("progress", { max: 1, value: 0, "aria-label": "Starts that are done" });
    const status = element("p", { role: "status", class: "about" });
    const fault = element("p", { class: "fault", role: "alert" });
    const found = element("div", { class: "found" });
    place.append(element("div", { class: "fitting" },
      element("fieldset", {}, element("legend", {}, "Parameters to fit; the others are held where the sliders stand"), list),
      element("div", { class: "field" }, element("label", { for: startsId }, "Starts: the first from the sliders, others spread over the bounds"), starts),
      element("div", { class: "buttons" }, begin, cancel), bar, status, fault, found));
    let shown = "", wanted = 1;
    const boxes = new Map();

    const rebuild = model => {
      boxes.clear();
      list.replaceChildren(...app.catalogue.models[model].parameters.map(p => {
        const box = element("input", { type: "checkbox", onchange: () => set(settings => {
          // those that a fit holds by default are freed by name, the others held by name
          const key = p.fitted ? "held" : "free", names = new Set(listOf(settings[key]));
          if (box.checked === p.fitted) names.delete(p.name); else names.add(p.name);
          settings[key] = [...names];
        }) });
        boxes.set(p.name, { box, p });
        return element("label", { class: "check", title: p.about }, box, element("span", { class: "symbol" }, p.symbol), element("span", { class: "about" }, p.about));
      }));
    };
    const run = on => {
      begin.disabled = on;
      cancel.disabled = !on;
      if (!on) bar.value = 0;
    };
    // The values go to the sliders, one step of undo; models may have come and gone meanwhile.
    const takeOver = fit => {
      const { layers } = app.state, is = layer => layer?.model === fit.model && layer.name === fit.name;
      const index = is(layers[fit.layer]) ? fit.layer : layers.findIndex(is);
      if (index < 0) {
        status.textContent = "The model that was fitted is not shown any more: its values were not taken over.";
        return;
      }
      app.change(state => { Object.assign(state.layers[index].parameters, fit.values); });
    };
    app.on("answer:fit_started", () => { run(true); fault.textContent = ""; wanted = 1; status.textContent = "Fitting …"; bar.removeAttribute("value"); });
    app.on("answer:fit_progress", ({ done, of, chi2 }) => {
      wanted = Math.max(wanted, of);
      bar.max = of;
      bar.value = done;
      // the best of a search over some points is refined on all
      const what = of < wanted ? "the best start is refined on all points" : `${done} of ${of} starts are done`;
      status.textContent = `χ² of the sliders ${chiSquare(chi2)}; ${what}`;
    });
    app.on("disconnected", () => { run(false); status.textContent = ""; });
    app.on("answer:fit_cancelled", () => { run(false); status.textContent = "The fit was cancelled."; });
    app.on("answer:error", content => {
      if (content.about !== "fit" && content.about !== "cancel_fit") return;
      fault.textContent = content.text;
      // of a second fit that is refused, the first goes on
      if (!content.text.startsWith("a fit is running")) { run(false); status.textContent = ""; }
    });
    app.on("answer:fitted", fit => {
      run(false);
      const before = fit.chi2_before === null ? "" : `${chiSquare(fit.chi2_before)} → `;
      status.textContent = `χ² ${before}${chiSquare(fit.chi2)} over ${fit.count} values, from ${fit.starts} ${fit.starts === 1 ? "start" : "starts"}; the sliders stand at the fit. Undo takes them back.`;
      takeOver(fit);
      found.replaceChildren(...describeFit(fit, app, () => takeOver(fit)));
    });
    return {
      update(state) {
        const { model } = state.layers[state.active], { starts: count = 16, ...settings } = state.settings.fit ?? {};
        const held = listOf(settings.held), free = listOf(settings.free);
        if (shown !== model) { rebuild(model); shown = model; }
        for (const { box, p } of boxes.values()) box.checked = p.fitted ? !held.includes(p.name) : free.includes(p.name);
        if (starts.getRootNode().activeElement !== starts) starts.value = count;
      },
    };
  },
});

function describeFit(fit, app, take) {
  const per = share => `${written(100 * share, 3)} %`;
  const row = (kind, cells) => element("tr", {}, cells.map((cell, i) => element(kind === "th" || i === 0 ? "th" : "td", { scope: kind === "th" ? "col" : i === 0 ? "row" : null }, cell)));
  const unit = e => e.unit && e.unit !== "1" ? ` ${e.unit}` : "";
  const errors = (where, e) => [
    `${where} (${e.count} geometries)`,
    [e.intensity === null ? null : `intensity ${per(e.intensity)} (median)`, e.dolp === null ? null : `DoLP ${written(e.dolp, 2)} (rms)`, e.ratio === null ? null : `ratios ${written(e.ratio, 2)} (rms)`].filter(Boolean).join(", "),
  ];
  const parts = [
    element("p", { class: "verdict" }, element("strong", {}, fit.verdict)),
    element("table", { class: "estimates" },
      element("caption", {}, "Parameters with standard errors"),
      element("thead", {}, row("th", ["parameter", "value", "the data say"])),
      element("tbody", {}, fit.estimates.map(e => row("td", [e.symbol, e.written + unit(e), e.verdict])))),
    element("dl", {}, [
      ["χ² / degrees of freedom", `${chiSquare(fit.chi2)} / ${fit.freedom}${fit.reduced_chi2 === null ? "" : ` = ${written(fit.reduced_chi2, 3)}`}`],
      ["Uncertainties", fit.noise],
      fit.fitted && errors("Errors, fitted", fit.fitted),
      fit.predicted && errors(`Errors, held out: ${fit.held_out}`, fit.predicted),
      ["Starts", `${fit.converged} of ${fit.starts} reached a minimum, ${fit.optima} distinct`],
    ].filter(Boolean).flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)])),
  ];
  const { names, matrix } = fit.correlation;
  if (names.length > 1) {
    const colours = decoded(app.catalogue.colours.signed);
    const symbols = names.map(name => fit.estimates.find(e => e.name === name)?.symbol ?? name);
    parts.push(element("table", { class: "correlation" },
      element("caption", {}, "Correlations"),
      element("thead", {}, element("tr", {}, element("td"), symbols.map(symbol => element("th", { scope: "col" }, symbol)))),
      element("tbody", {}, matrix.map((line, i) => element("tr", {}, element("th", { scope: "row" }, symbols[i]), line.map(r => {
        const cell = element("td", {}, r === null ? "–" : r.toFixed(2).replace("-", "−"));
        if (r !== null) {
          const [red, green, blue] = colours.subarray(4 * Math.round((r + 1) / 2 * 255));
          cell.style.background = `rgb(${red} ${green} ${blue})`;
          cell.style.color = 0.299 * red + 0.587 * green + 0.114 * blue > 140 ? "#000" : "#fff";
        }
        return cell;
      }))))));
  }
  for (const text of fit.notes) parts.push(element("p", { class: "about" }, text));
  parts.push(element("button", { type: "button", onclick: take }, "Take the fitted values over again"));
  return parts;
}
