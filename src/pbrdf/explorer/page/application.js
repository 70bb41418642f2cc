// The state, its history, and the conversation with Dr.Jit behind the page.

// Views and panels enter themselves here; see views/hemisphere.js and panels/parameters.js.
const VIEWS = [], PANELS = [];
// Steps that can be undone, at most.
const MOST_STEPS = 300;

class Application {
  constructor(model) {
    this.model = model;
    this.listeners = new Map();
    this.past = [];
    this.future = [];
    this.state = null;
    this.theme = "light";
    this.asked = 0;
    this.drawing = false;
    this.wanted = null;
    this.shownViews = () => [];
    // listeners outside the explorer's element take this signal, so that they end with it
    this.ending = new AbortController();
    this.signal = this.ending.signal;
    this.hear = (content, buffers) => this.receive(content, buffers ?? []);
    this.lose = (why, anew) => { this.drawing = false; this.tell("disconnected", why, anew); };
    // what was asked for meanwhile went nowhere
    this.find = () => { this.drawing = false; this.tell("connected"); };
    model.on("msg:custom", this.hear);
    model.on("disconnected", this.lose);
    model.on("connected", this.find);
  }

  on(event, listener) { this.listeners.set(event, [...this.listeners.get(event) ?? [], listener]); }
  tell(event, ...values) { for (const listener of this.listeners.get(event) ?? []) listener(...values); }
  send(content, buffers = []) { this.model.send(content, undefined, buffers); }

  // Give up everything that outlives the element.
  end() {
    this.send({ type: "goodbye" });
    this.model.off("msg:custom", this.hear);
    this.model.off("disconnected", this.lose);
    this.model.off("connected", this.find);
    this.ending.abort();
    this.listeners.clear();
  }

  // Change the state: `change` edits a copy. While a slider is dragged pictures are drawn fast, and only the end of
  // the drag is a step of undo. `views` names those whose pictures change, all by default.
  change(change, { dragging = false, views = null } = {}) {
    const before = this.state;
    const next = structuredClone(before);
    change(next);
    this.undoable ??= before;
    this.state = next;
    if (!dragging) this.keep();
    // pictures are asked for first, and computed while the page follows
    this.draw(dragging, views);
    this.tell("state", { dragging });
  }

  // Show another state altogether, a step of undo as well.
  replace(state) {
    this.undoable ??= this.state;
    this.state = structuredClone(state);
    this.keep();
    this.tell("state", { dragging: false });
    this.draw();
  }

  // What stood before the change, or the drag, becomes a step of undo.
  keep() {
    if (this.undoable && JSON.stringify(this.undoable) !== JSON.stringify(this.state)) {
      this.past.push(this.undoable);
      if (this.past.length > MOST_STEPS) this.past.shift();
      this.future = [];
    }
    this.undoable = null;
  }

  undo() { this.step(this.past, this.future); }
  redo() { this.step(this.future, this.past); }
  step(from, to) {
    if (!from.length) return;
    to.push(this.state);
    this.state = from.pop();
    this.undoable = null;
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
    this.tell("drawing");
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
