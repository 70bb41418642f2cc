// The state in the address, and in files.

// A fragment never leaves the browser: what is looked at is in no log.
const FRAGMENT = "#state=";
// Time after the last change before the address follows; browsers refuse a hundred changes in a few seconds.
const SETTLED = 250;

function encodedState(state) {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

// The state of an address or a fragment, null where it holds none, undefined where what it holds is spoilt.
function stateOfAddress(address) {
  const at = address.indexOf(FRAGMENT);
  if (at < 0) return null;
  try {
    const text = atob(address.slice(at + FRAGMENT.length).trim().replaceAll("-", "+").replaceAll("_", "/"));
    return JSON.parse(new TextDecoder().decode(Uint8Array.from(text, c => c.charCodeAt(0))));
  } catch { return undefined; }
}

const addressOf = state => location.href.split("#")[0] + FRAGMENT + encodedState(state);

// Let the address follow the state. `open` is told what stands in an address that somebody goes to.
function followAddress(app, open) {
  let timer = 0, written = location.href;
  app.on("state", ({ dragging }) => {
    clearTimeout(timer);
    if (!dragging) timer = setTimeout(() => { written = addressOf(app.state); history.replaceState(null, "", written); }, SETTLED);
  });
  window.addEventListener("hashchange", () => {
    if (location.href !== written && location.hash.startsWith(FRAGMENT)) open(stateOfAddress(location.hash));
  }, { signal: app.signal });
  app.signal.addEventListener("abort", () => clearTimeout(timer));
}
