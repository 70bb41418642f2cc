// What is shown, kept as a file: figures and tables as the command line makes them, and the command that does.

const EXPORTS = [
  ["Figures of all shown models", [["curves", "curves in the plane of incidence"], ["hemisphere", "hemispheres"], ["surface", "polar surfaces"], ["mueller", "Mueller elements"]]],
  ["Of the active model", [["overview", "figure: overview"], ["plane", "table: plane of incidence"], ["directions", "table: all directions"], ["model", "model file"], ["fit", "fit to the data: the command"]]],
];
const FORMATS_OF = { fit: [], plane: ["csv"], directions: ["csv"], model: ["json"] }, FIGURE_FORMATS = ["png", "svg", "pdf"];

PANELS.push({
  name: "export",
  title: "Export",
  build(place, app) {
    const what = selectField("What", EXPORTS, () => choose());
    const format = selectField("As", [], () => {});
    const choose = () => {
      const formats = FORMATS_OF[what.select.value] ?? FIGURE_FORMATS;
      format.select.replaceChildren(...formats.map(f => element("option", { value: f }, f.toUpperCase())));
      format.select.disabled = formats.length <= 1;
      save.textContent = what.select.value === "fit" ? "Show" : "Save";
    };
    const save = element("button", { type: "button", onclick: () => {
      save.disabled = true;
      said.textContent = "";
      app.send({ type: "export", what: what.select.value, format: format.select.value, state: app.state });
    } }, "Save");
    const said = element("p", { class: "about", role: "status" });
    const command = element("code", { tabindex: 0, role: "group", "aria-label": "The command that makes the same" });
    const copy = iconButton("copy", "Copy the command", async () => {
      if (!await copied(command.textContent)) getSelection().selectAllChildren(command);
      else said.textContent = "The command is on the clipboard.";
    });
    const line = element("div", { class: "command", hidden: true }, command, copy);
    place.append(element("div", { class: "what" }, what.node, format.node), element("div", { class: "buttons" }, save), line, said);
    choose();
    app.on("answer:exported", (content, [file]) => {
      save.disabled = false;
      if (file) download(content.name, [file], content.media);
      const files = file && content.command && /\.json\b/.test(content.command) ? "the command reads the models' files: save those, too" : "";
      said.textContent = [file ? `${content.name} is saved` : "", content.note, files].filter(Boolean).join("; ");
      command.textContent = content.command ?? "";
      line.hidden = !content.command;
    });
    app.on("answer:error", content => { if (content.about === "export") save.disabled = false; });
    for (const event of ["disconnected", "connected"]) app.on(event, () => { save.disabled = false; });
    return { update() {} };
  },
});
