// The measured data that are open: which are shown, and what a fit leaves out and then predicts.

PANELS.push({
  name: "data",
  title: "Measured data",
  build(place, app) {
    const set = edit => app.change(state => edit(state.settings.data ??= {}), ONLY_CUTS);
    const words = element("p", { class: "about" }, "No measured data are open. Drop a file of data on the page, or start with: pbrdf explore FILE");
    const inside = element("div", { class: "measured", hidden: true });
    const fault = element("p", { class: "fault", role: "alert" });
    place.append(words, inside, fault);
    let asked = null, described = null, offButton = null;
    const held = new Map();

    const field = (label, node) => {
      node.id = freshId("data");
      return element("div", { class: "field" }, element("label", { for: node.id }, label), node);
    };
    const chosen = state => {
      const { set: name, wavelength } = state.settings.data ?? {};
      return JSON.stringify([name ?? null, wavelength ?? null]);
    };
    const ask = () => { asked = chosen(app.state); app.send({ type: "data", state: app.state }); };

    const build = ({ sets, chosen: data }) => {
      words.hidden = sets.length > 0;
      inside.hidden = sets.length === 0;
      inside.replaceChildren();
      held.clear();
      described = data;
      if (!data) return;
      const option = (value, text, selected) => element("option", { value, selected }, text);
      if (sets.length > 1) {
        const choose = element("select", { onchange: () => set(settings => {
          settings.set = choose.value;
          for (const key of ["wavelength", "off", "held_out"]) delete settings[key];
        }) }, sets.map(name => option(name, name, name === data.name)));
        inside.append(field("Data set", choose));
      }
      const notes = [data.simulated ? "simulated" : null, data.arbitrary ? "arbitrary scale" : null].filter(Boolean);
      inside.append(element("p", {}, element("strong", {}, data.name), ` · ${data.shown} ${data.shown === 1 ? "geometry" : "geometries"}${notes.length ? ` · ${notes.join(", ")}` : ""}`));
      if (data.title) inside.append(element("p", { class: "about" }, data.title));
      inside.append(element("p", { class: "about" }, `Measured: ${data.measured.join(", ")}. Uncertainties: ${data.noise}.`));
      if (data.wavelengths.length > 1) {
        const choose = element("select", { onchange: () => set(settings => {
          settings.wavelength = Number(choose.value);
          delete settings.held_out;
        }) }, data.wavelengths.map(w => option(String(w), `${written(w, 6)} nm`, w === data.wavelength)));
        inside.append(field("Wavelength", choose));
      }
      const light = data.light.map(s => s / data.light[0]), now = app.state.light.stokes;
      if (light.some((s, i) => Math.abs(s - now[i]) > 1e-6)) {
        inside.append(element("button", { type: "button", onclick: () => { app.change(state => { state.light.stokes = light; }); ask(); } }, "Use the light of the measurement"));
      }
      if (data.incidences.length > 1) {
        const choose = element("select", { onchange: () => { if (choose.value !== "") app.change(state => { state.light.theta_i = Number(choose.value); }); } },
          option("", "choose …", true), data.incidences.map(a => option(String(a), `${written(a, 4)}°`, false)));
        inside.append(field("Light at a measured angle of incidence", choose));
      }
      for (const [kind, title, values, name] of [
        ["group", "Hold out: positions (groups)", data.groups, v => `group ${v}`],
        ["theta_i", "Hold out: angles of incidence", data.groups.length ? [] : data.incidences, v => `${written(v, 4)}°`],
      ]) {
        if (values.length < 2) continue;
        const boxes = values.map(value => {
          const box = element("input", { type: "checkbox", onchange: () => set(settings => {
            const before = settings.held_out?.kind === kind ? listOf(settings.held_out.values) : [];
            const after = box.checked ? [...before, String(value)] : before.filter(v => v !== String(value));
            settings.held_out = after.length ? { kind, values: after } : null;
          }) });
          held.set(`${kind}=${value}`, box);
          return element("label", { class: "check" }, box, name(value));
        });
        inside.append(element("fieldset", {}, element("legend", {}, title), element("div", { class: "list" }, boxes)));
      }
      offButton = element("button", { type: "button", onclick: () => set(settings => { settings.off = []; }) });
      inside.append(offButton);
      mark(app.state);
    };
    const mark = state => {
      const { off: given, held_out: out } = state.settings.data ?? {}, off = listOf(given);
      for (const [key, box] of held) box.checked = listOf(out?.values).some(value => key === `${out.kind}=${value}`);
      if (!offButton) return;
      offButton.disabled = off.length === 0;
      offButton.textContent = off.length ? `Switch ${off.length} ${off.length === 1 ? "point" : "points"} on again` : "All points are switched on";
    };
    app.on("answer:data", content => { fault.textContent = ""; build(content); });
    app.on("connected", () => { if (app.state) ask(); });
    // settings of other data, from a state that was sent: they can be given up
    app.on("answer:error", content => {
      if (content.about !== "data") return;
      fault.textContent = content.text;
      described = offButton = null;
      words.hidden = true;
      inside.hidden = false;
      inside.replaceChildren(element("button", { type: "button", onclick: () => {
        asked = null;
        app.change(state => { delete state.settings.data; }, ONLY_CUTS);
      } }, "Show what is open, all of its points"));
    });
    return {
      update(state) {
        if (asked !== chosen(state)) ask();
        if (described) mark(state);
      },
    };
  },
});
