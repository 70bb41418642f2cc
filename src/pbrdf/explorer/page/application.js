// The state, its history, and the conversation with Dr.Jit behind the page.

// Views and panels enter themselves here; see views/hemisphere.js and controls.js.
const VIEWS = [], PANELS = [];

class Application {
  constructor(model) {
    this.model = model;
    this.listeners = new Map();
    this.past = [];
    this.future = [];
    this.asked = 0;
    this.drawing = false;
    this.wanted = null;
    this.shownViews = () => [];
    model.on("msg:custom", (content, buffers) => this.receive(content, buffers ?? []));
    model.on("disconnected", () => this.tell("disconnected"));
  }

  on(event, listener) { this.listeners.set(event, [...this.listeners.get(event) ?? [], listener]); }
  tell(event, ...values) { for (const listener of this.listeners.get(event) ?? []) listener(...values); }
  send(content, buffers = []) { this.model.send(content, undefined, buffers); }

  // Change the state: `change` edits a copy. While a slider is dragged pictures are drawn fast, and only the end of
  // the drag is a step of undo. `views` names those whose pictures change, all by default.
  change(change, { dragging = false, views = null } = {}) {
    const before = this.state;
    const next = structuredClone(before);
    change(next);
    if (!this.undoable) this.undoable = before;
    this.state = next;
    if (!dragging) {
      if (JSON.stringify(this.undoable) !== JSON.stringify(next)) { this.past.push(this.undoable); this.future = []; }
      this.undoable = null;
    }
    this.tell("state", { dragging });
    this.draw(dragging, views);
  }

  replace(state) { this.change(next => { for (const key of Object.keys(next)) delete next[key]; Object.assign(next, structuredClone(state)); }); }
  undo() { this.step(this.past, this.future); }
  redo() { this.step(this.future, this.past); }
  step(from, to) {
    if (!from.length) return;
    to.push(this.state);
    this.state = from.pop();
    this.tell("state", { dragging: false });
    this.draw(false);
  }

  // Ask for pictures: one request at a time, the latest wins.
  draw(dragging = false, only = null) {
    if (!this.state || only?.length === 0) return;
    if (this.drawing) {
      // where all are wanted already, all stay wanted
      const both = only && this.wanted?.only !== null ? [...new Set([...only, ...this.wanted?.only ?? []])] : null;
      this.wanted = { dragging, only: both };
      return;
    }
    const views = this.shownViews().filter(view => !only || only.includes(view));
    if (!views.length) return;
    this.drawing = true;
    this.wanted = null;
    this.send({ type: "draw", id: ++this.asked, views, dragging, state: this.state });
  }

  receive(content, buffers) {
    if (content.type === "picture") this.tell(`picture:${content.view}`, content, buffers);
    else this.tell(`answer:${content.type}`, content, buffers);
    const drawn = content.type === "picture" ? content.last : content.type === "superseded";
    if (drawn || (content.type === "error" && content.about === "draw")) {
      this.drawing = false;
      this.tell("drawn", content);
      if (this.wanted) this.draw(this.wanted.dragging, this.wanted.only);
    }
  }
}
