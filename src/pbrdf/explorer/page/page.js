// The page: an AnyWidget model over a WebSocket, for the module that notebooks use too.
import explorer from "./explorer.js";

const ALIGNMENT = 8;
const encoder = new TextEncoder(), decoder = new TextDecoder();

function pack(content, buffers) {
  const parts = buffers.map(b => new Uint8Array(b.buffer ?? b, b.byteOffset ?? 0, b.byteLength));
  const text = encoder.encode(JSON.stringify({ ...content, buffers: parts.map(p => p.byteLength) }));
  let size = 4 + text.byteLength;
  const places = parts.map(p => { size += -size & (ALIGNMENT - 1); const at = size; size += p.byteLength; return at; });
  const frame = new Uint8Array(size);
  new DataView(frame.buffer).setUint32(0, text.byteLength, true);
  frame.set(text, 4);
  parts.forEach((p, i) => frame.set(p, places[i]));
  return frame;
}

function unpack(frame) {
  const length = new DataView(frame).getUint32(0, true);
  const content = JSON.parse(decoder.decode(new Uint8Array(frame, 4, length)));
  let at = 4 + length;
  const buffers = content.buffers.map(size => {
    at += -at & (ALIGNMENT - 1);
    const view = new DataView(frame, at, size);
    at += size;
    return view;
  });
  return [content, buffers];
}

// Milliseconds before a lost connection is tried again, at first and in the end.
const SOON = 500, LATE = 8000;
// Code of a connection that is closed as there are too many.
const FULL = 1013;

// Whether another start of the program answers here, whose token this page does not have; sockets do not say why they
// were refused.
async function tokenIsRefused() {
  try {
    return (await fetch("/", { cache: "no-store", signal: AbortSignal.timeout(LATE) })).status === 403;
  } catch { return false; }
}

// What AnyWidget gives a module: values by name and custom messages.
class SocketModel {
  constructor(address) {
    this.listeners = new Map();
    this.values = new Map();
    this.waiting = [];
    this.address = address;
    this.pause = SOON;
    this.over = false;
    this.connect();
  }
  // A lost connection is tried again, at first soon; what was to be sent meanwhile is not: the page asks anew.
  connect() {
    const again = Boolean(this.socket);
    let taken = false;
    this.socket = new WebSocket(this.address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      taken = true;
      this.pause = SOON;
      const waiting = this.waiting;
      this.waiting = [];
      if (again) this.tell("connected"); else waiting.forEach(f => this.socket.send(f));
    };
    this.socket.onmessage = event => this.tell("msg:custom", ...unpack(event.data));
    this.socket.onclose = async event => {
      // the server says why it takes no more pages
      this.tell("disconnected", event.code === FULL ? event.reason : "");
      if (!taken && await tokenIsRefused()) {
        this.over = true;
        this.tell("disconnected", "", true);
        return;
      }
      setTimeout(() => this.connect(), this.pause);
      this.pause = Math.min(2 * this.pause, LATE);
    };
  }
  get(name) { return this.values.get(name); }
  set(name, value) { this.values.set(name, value); this.tell(`change:${name}`); }
  save_changes() {}
  on(event, listener) { this.listeners.set(event, [...this.listeners.get(event) ?? [], listener]); }
  off(event, listener) { this.listeners.set(event, (this.listeners.get(event) ?? []).filter(l => l !== listener)); }
  tell(event, ...values) { (this.listeners.get(event) ?? []).forEach(listener => listener(...values)); }
  send(content, callbacks, buffers = []) {
    const frame = pack(content, buffers);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(frame);
    else if (this.over) queueMicrotask(() => this.tell("disconnected", "", true));
    else this.waiting.push(frame);
  }
}

// the token stands in a cookie now: out of the address, which may be shown and sent
if (new URLSearchParams(location.search).has("token")) history.replaceState(null, "", location.pathname + location.hash);
const model = new SocketModel(`ws://${location.host}/socket`);
// the state of the page stands in the address: a reload, or a colleague with the same data, sees the same
model.set("address", true);
explorer.render({ model, el: document.getElementById("explorer") });
