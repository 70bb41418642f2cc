// What a table does not say of itself is asked, and the file read again: the options that `pbrdf check` names.

function askerOf(app, root) {
  // files that were sent and not answered yet, by the number of the request
  const sent = new Map();
  let count = 0, asked = null;

  const send = async (file, options = {}) => {
    const id = `file-${++count}`;
    sent.set(id, file);
    app.tell("note", `Opening ${file.name} …`, true);
    app.send({ type: "open", id, name: file.name, options }, [await file.arrayBuffer()]);
  };

  const title = element("h2", {}), fault = element("p", { class: "fault", role: "status" }), fields = element("div", { class: "unsaid-fields" });
  const form = element("form", { onsubmit: event => {
    event.preventDefault();
    dialog.close();
    send(asked, given());
  } }, fault, fields, element("div", { class: "actions" },
    element("button", { type: "submit", class: "first" }, "Read it again"),
    element("button", { type: "button", onclick: () => dialog.close() }, "Leave it")));
  const dialog = element("dialog", { class: "help unsaid", "aria-label": "How a file is to be read" },
    element("header", {}, title, iconButton("remove", "Close", () => dialog.close())), form);
  root.append(dialog);

  let choices = new Map(), texts = new Map(), skip = null;
  // "I=value, theta_i=in" as an object
  const pairs = text => Object.fromEntries(text.split(",").map(part => part.split("=").map(side => side.trim())).filter(([name, value]) => name && value));
  function given() {
    const options = {};
    for (const [name, field] of choices) if (field.select.value) options[name] = field.select.value;
    for (const [name, input] of texts) if (Object.keys(pairs(input.value)).length) options[name] = pairs(input.value);
    if (skip.checked) options.skip_invalid = true;
    return options;
  }
  function build(offered) {
    texts = new Map();
    choices = new Map(Object.entries(offered).map(([name, values]) => [name, selectField(ABOUT_OPTIONS[name] ?? name, [["", [["", "as the file says"], ...values.map(value => [value, value.replaceAll("_", " ")])]]], () => {})]));
    const rows = [["column", "columns, as I=value, theta_i=in"], ["unit", "units, as I=%"]].map(([name, label]) => {
      const input = element("input", { type: "text", id: freshId(name), autocomplete: "off", spellcheck: "false" });
      texts.set(name, input);
      return element("div", { class: "field" }, element("label", { for: input.id }, label), input);
    });
    skip = element("input", { type: "checkbox" });
    fields.replaceChildren(...[...choices.values()].map(field => field.node), ...rows,
      element("label", { class: "check" }, skip, " leave out rows without a usable value"));
  }

  app.on("answer:opened", ({ id }) => sent.delete(id));
  for (const event of ["disconnected", "connected"]) app.on(event, () => {
    if (!sent.size) return;
    app.tell("note", `${[...sent.values()].map(file => file.name).join(", ")}: not opened, as the program did not answer; open again what is missing.`, true);
    sent.clear();
  });
  app.on("answer:error", content => {
    const file = sent.get(content.id);
    if (content.about !== "open" || !file) return;
    sent.delete(content.id);
    if (!content.choices || dialog.open) return;
    if (asked !== file) build(content.choices);
    asked = file;
    title.textContent = file.name;
    fault.textContent = content.text;
    dialog.showModal();
  });
  return { send, close: () => dialog.close() };
}

const ABOUT_OPTIONS = {
  quantity: "what was measured",
  azimuth: "where forward is",
  stokes: "what Q > 0 means",
  angles: "angles are in",
};
