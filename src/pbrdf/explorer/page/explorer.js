// The module: builds the page in an element and talks to an AnyWidget model.
//
// A view has the body of a card as its place and fills its width; `wide: true` gives it two columns. Settings of the
// page itself: `settings.page.views` are the names of the views on the stage, `settings.page.large` is an enlarged one.

const THEMES = { auto: "as the system", light: "light", dark: "dark" };
// Views that a page begins with, of those that there are.
const FIRST_VIEWS = ["hemisphere", "cuts", "polar", "sphere"];

function render({ model, el }) {
  const app = new Application(model);
  const root = element("div", { class: "frame" });
  el.classList.add("pbrdf-explorer");
  el.append(root);
  const inPage = model.get("address") === true;
  const notices = noticesOf(app);
  const theme = themeOf(app, el, inPage);
  const files = openFiles(app, root);
  const help = helpOf(inPage);
  const undo = iconButton("undo", "Undo (Ctrl+Z)", () => app.undo()), redo = iconButton("redo", "Redo (Ctrl+Shift+Z)", () => app.redo());
  const ofState = [
    undo, redo,
    iconButton("save", "Save the state to a file", () => download(`${fileStem(app.state)}.explorer.json`, [JSON.stringify(app.state, null, 2)], "application/json")),
    inPage && iconButton("link", "Copy a link to what is shown", async () => {
      const address = addressOf(app.state);
      app.tell("note", await copied(address) ? "The link is on the clipboard. Elsewhere, what follows its # opens the same on an explorer of one's own." : address);
    }),
  ].filter(Boolean);
  const busy = element("span", { class: "busy", "aria-hidden": "true" });
  root.append(
    element("header", { class: "top" },
      element("p", { class: "brand" }, element("strong", {}, "pbrdf"), " explorer"), busy,
      element("div", { class: "tools", role: "group", "aria-label": "State and page" },
        ofState[0], ofState[1], iconButton("open", "Open a file", files.choose), ...ofState.slice(2), theme, iconButton("help", "Help and keyboard", () => help.showModal()))),
    help);
  const body = element("div", { class: "body" });
  root.append(body, notices);
  app.on("drawing", () => busy.classList.add("on"));
  app.on("drawn", () => busy.classList.toggle("on", Boolean(app.wanted)));

  // on the page all keys are the explorer's, in a notebook those in its cell
  (inPage ? document : el).addEventListener("keydown", event => {
    const typing = event.target.matches("input:not([type=range]):not([type=radio]):not([type=checkbox]), textarea");
    if (!(event.ctrlKey || event.metaKey) || typing || event.altKey) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    if (key === "y" || event.shiftKey) app.redo(); else app.undo();
  }, { signal: app.signal });

  const open = (state, from) => {
    if (state === undefined) app.tell("note", `${from} holds no state that can be read.`);
    else if (state !== null) app.send({ type: "read_state", state, from });
  };
  let workbench = null;
  const show = () => {
    for (const button of ofState) button.disabled = !app.state;
    undo.disabled = !app.past.length;
    redo.disabled = !app.future.length;
    if (app.state && !workbench) {
      workbench = workbenchOf(app, root);
      body.replaceChildren(...workbench.nodes);
    } else if (!app.state && !body.firstChild) body.append(emptyState(app, files));
    workbench?.update();
    if (inPage && app.state) document.title = `${app.state.layers[app.state.active].name} · pbrdf explorer`;
  };
  app.on("state", show);

  const begin = state => { if (state) app.replace(state); else show(); };
  let given = null;
  app.on("answer:welcome", content => {
    notices.lost(false);
    // after a lost connection the page's own state stands
    if (app.catalogue) { app.draw(); return; }
    app.catalogue = content.catalogue;
    given = content.state;
    const asked = inPage ? stateOfAddress(location.hash) : null;
    if (inPage) followAddress(app, state => open(state, "the address"));
    if (asked !== null) open(asked, "the address");
    if (!asked) begin(given);
  });
  app.on("answer:read_state", content => app.replace(content.state));
  app.on("answer:error", content => {
    // an address that is refused leaves what the program was given
    if (content.about === "read_state" && !app.state) begin(given);
    if (content.about !== "draw") app.tell("note", content.text, true);
  });
  app.on("connected", () => app.send({ type: "hello" }));
  app.send({ type: "hello" });
  return () => { help.close(); files.close(); app.end(); root.remove(); };
}

// The panels and the views of a state.
function workbenchOf(app, root) {
  const side = element("aside", { class: "side", "aria-label": "Controls" });
  const stage = element("div", { class: "stage", role: "group", "aria-label": "Pictures" });
  const bar = element("div", { class: "views", role: "group", "aria-label": "Views" });
  const wide = root.clientWidth > 700;
  const panels = PANELS.map((panel, i) => {
    const place = element("div", { class: "inside" });
    side.append(element("details", { class: "panel", "data-panel": panel.name, open: wide || i < 2 }, element("summary", {}, element("h2", {}, panel.title)), place));
    return panel.build(place, app);
  });

  const built = new Map(), toggles = new Map();
  const known = new Map(VIEWS.map(view => [view.name, view]));
  const first = FIRST_VIEWS.filter(name => known.has(name));
  const page = state => state.settings.page ??= {};
  const viewsOf = state => {
    const asked = state.settings?.page?.views;
    return Array.isArray(asked) ? asked.filter(name => known.has(name)) : first.length ? first : [...known.keys()];
  };
  const toggle = name => app.change(state => {
    const views = viewsOf(state);
    page(state).views = [...known.keys()].filter(other => views.includes(other) !== (other === name));
  });
  for (const view of VIEWS) {
    const button = element("button", { type: "button", class: "chip", "aria-pressed": "false", onclick: () => toggle(view.name) }, view.title);
    toggles.set(view.name, button);
    bar.append(button);
  }
  const nothing = element("p", { class: "nothing" }, "No view is on: choose one above.");
  stage.append(nothing);

  // A view is built when it is first shown, between those that come before and after it.
  function cardOf(name) {
    if (built.has(name)) return built.get(name);
    const view = known.get(name), place = element("div", { class: "view" });
    const large = iconButton("enlarge", `Enlarge ${view.title}`, () => {
      app.change(state => { page(state).large = state.settings.page.large === name ? null : name; });
      // it may have moved below the others
      node.scrollIntoView({ block: "nearest" });
    }, { "aria-pressed": "false" });
    const fault = element("p", { class: "fault", role: "status" });
    const node = element("article", { class: view.wide ? "card wide" : "card", "data-view": name, "aria-label": view.title },
      element("header", {}, element("h2", {}, view.title), large, iconButton("remove", `Close ${view.title}`, () => { toggle(name); toggles.get(name).focus(); })), place, fault);
    const after = [...known.keys()].slice([...known.keys()].indexOf(name) + 1).map(other => built.get(other)?.node).find(Boolean);
    stage.insertBefore(node, after ?? nothing);
    const card = { node, large, fault, shown: null };
    built.set(name, card);
    try { card.shown = view.build(place, app); } catch (error) { fault.textContent = error.message; node.classList.add("faulty"); }
    return card;
  }
  for (const [name] of known) app.on(`picture:${name}`, (header, buffers) => {
    const card = built.get(name);
    if (!card?.shown) return;
    card.fault.textContent = header.error ?? "";
    card.node.classList.toggle("faulty", Boolean(header.error));
    if (header.error) faults.set(header.place, header.error); else card.shown.show(header, buffers);
  });
  app.shownViews = () => viewsOf(app.state).filter(name => cardOf(name).shown);

  // Errors are said beside the control whose path they name, else in the notices.
  const faults = new Map();
  app.on("drawing", () => faults.clear());
  app.on("drawn", content => {
    if (content.type === "error") faults.set(content.place, content.text);
    const unsaid = sayFaults(side, faults);
    if (content.type === "error" && unsaid.length) app.tell("note", unsaid.join(" "), true);
  });

  const update = () => {
    const state = app.state, views = viewsOf(state);
    panels.forEach(panel => panel.update(state));
    for (const name of views) cardOf(name);
    for (const [name, card] of built) {
      card.node.hidden = !views.includes(name);
      const large = state.settings.page?.large === name;
      card.node.classList.toggle("large", large);
      card.large.setAttribute("aria-pressed", large);
    }
    for (const [name, button] of toggles) button.setAttribute("aria-pressed", views.includes(name));
    nothing.hidden = views.length > 0;
  };
  return { nodes: [side, element("section", { class: "main", "aria-label": "Views" }, bar, stage)], update };
}

// Say each fault in the element whose `data-place` is nearest above its own; gives the texts that had none.
function sayFaults(side, faults) {
  const places = [...side.querySelectorAll("[data-place]")];
  for (const node of places) {
    const fault = node.querySelector(":scope > .fault.said");
    if (fault) fault.remove();
    node.classList.remove("faulty");
    node.querySelectorAll(".refused").forEach(input => { input.classList.remove("refused"); input.removeAttribute("aria-invalid"); });
  }
  const unsaid = [];
  for (const [place, text] of faults) {
    const above = places.filter(node => place && (place === node.dataset.place || place.startsWith(`${node.dataset.place}.`)));
    const node = above.sort((a, b) => b.dataset.place.length - a.dataset.place.length)[0];
    if (!node) { unsaid.push(text); continue; }
    node.classList.add("faulty");
    node.append(element("p", { class: "fault said", role: "alert" }, text));
    node.querySelectorAll("input, select").forEach(input => { input.classList.add("refused"); input.setAttribute("aria-invalid", "true"); });
  }
  return unsaid;
}

// Sentences that concern the whole page.
function noticesOf(app) {
  const text = element("p", {}), lost = element("p", { hidden: true });
  const box = element("div", { class: "notice", role: "status", hidden: true }, text, iconButton("remove", "Close this message", () => { box.hidden = true; }));
  const gone = element("div", { class: "notice gone", role: "alert", hidden: true }, lost);
  let timer = 0;
  app.on("note", (words, stays = false) => {
    clearTimeout(timer);
    text.textContent = words;
    box.hidden = false;
    if (!stays) timer = setTimeout(() => { box.hidden = true; }, 12000);
  });
  const node = element("div", { class: "notices" }, gone, box);
  node.lost = (is, why, anew) => {
    gone.hidden = lost.hidden = !is;
    lost.textContent = !is ? "" : anew ? "The program was started anew, which this page does not belong to: open its new address. The part of this page's address after # shows the same there." : why ? `This page cannot be served: ${why}; trying again.` : "The program behind this page does not answer; trying again. If it has ended, start pbrdf explore anew and open the address that it tells: the part of this page's address after # shows the same there.";
  };
  app.on("disconnected", (why, anew) => node.lost(true, why, anew));
  return node;
}

// The button of the theme; the theme stands for this tab alone.
function themeOf(app, el, inPage) {
  const KEY = "pbrdf-explorer-theme";
  const system = matchMedia("(prefers-color-scheme: dark)");
  let chosen = "auto";
  try { chosen = sessionStorage.getItem(KEY) ?? "auto"; } catch { /* a notebook may have no storage */ }
  if (!(chosen in THEMES)) chosen = "auto";
  // notebooks have a theme of their own
  const surroundings = () => {
    const { jpThemeLight } = document.body.dataset;
    if (!inPage && jpThemeLight) return jpThemeLight === "true" ? "light" : "dark";
    if (!inPage && document.body.classList.contains("dark")) return "dark";
    return system.matches ? "dark" : "light";
  };
  const button = iconButton("auto", "Theme", () => {
    const names = Object.keys(THEMES);
    chosen = names[(names.indexOf(chosen) + 1) % names.length];
    try { sessionStorage.setItem(KEY, chosen); } catch { /* as above */ }
    apply();
  });
  function apply() {
    app.theme = chosen === "auto" ? surroundings() : chosen;
    el.dataset.theme = app.theme;
    relabel(button, chosen, `Theme: ${THEMES[chosen]}`);
    app.tell("theme", app.theme);
  }
  system.addEventListener("change", apply, { signal: app.signal });
  apply();
  return button;
}

function helpOf(inPage) {
  const keys = [
    ["Tab, Shift+Tab", "to the next or previous control"], ["← →", "move a slider by a thousandth"], ["Page Up, Page Down", "by a tenth"], ["Home, End", "to its ends"],
    ["↑ ↓ in a number", "as the slider's arrows"], ["Enter, Escape in a number", "take it, give it up"], ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"],
    ["← → in the curves", "from point to point, or along them"], ["Space in the curves", "switch the point off or on"],
  ];
  const dialog = element("dialog", { class: "help", "aria-label": "Help" },
    element("header", {}, element("h2", {}, "Help"), iconButton("remove", "Close the help", () => dialog.close())),
    element("p", {}, "Everything is computed by pbrdf on this machine; the page only draws. While a slider moves the pictures are quick ones, at rest they have the library's default accuracy."),
    element("p", {}, inPage ? "The address always holds what is shown: reload it, keep it, or save the state to a file to send it. Nothing leaves this machine, and nothing is written unless you save it." : "Save the state to a file to keep or send what is shown."),
    element("p", {}, "Angles are in degrees. Azimuth 0 is the forward half-plane, where a mirror reflects to; in the plane of incidence negative viewing angles are on the source's side. Q > 0 is polarised in the plane of direction and normal (p), V > 0 turns anticlockwise for the receiver."),
    element("dl", {}, keys.flatMap(([key, does]) => [element("dt", {}, key), element("dd", {}, does)])));
  return dialog;
}

// The beginning of the names of files that are saved.
const fileStem = state => state.layers[state.active].name.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "") || "model";

export default { render };
