// Elements of the page.

// An element with attributes, listeners (onclick and the like) and children.
function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked" || key === "disabled" || key === "hidden") node[key] = value;
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(Infinity).filter(child => child !== null && child !== undefined));
  return node;
}

// An SVG element, likewise.
function drawn(name, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

// Elements have ids of their own for labels: a notebook may hold several explorers.
let elementCount = 0;
const freshId = name => `pbrdf-${name}-${++elementCount}`;

// A number in few digits, with a true minus sign.
const written = (value, digits = 3) => Number(value.toPrecision(digits)).toString().replaceAll("-", "−");
// The number that somebody wrote, NaN where it is none.
const understood = text => text.trim() === "" ? NaN : Number(text.trim().replaceAll("−", "-").replace(",", "."));

// A list of a state that came from elsewhere, none where it is something else.
const listOf = value => Array.isArray(value) ? value : [];

// Strokes of the icons on a field of 24 by 24.
const ICONS = {
  undo: "M9 14 4 9l5-5 M4 9h10a6 6 0 0 1 0 12h-3",
  redo: "M15 14l5-5-5-5 M20 9H10a6 6 0 0 0 0 12h3",
  light: "M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8z M12 2v2 M12 20v2 M2 12h2 M20 12h2 M5 5l1.4 1.4 M17.6 17.6 19 19 M5 19l1.4-1.4 M17.6 6.4 19 5",
  dark: "M20 14.5A8.5 8.5 0 0 1 9.5 4 8.5 8.5 0 1 0 20 14.5z",
  auto: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18z M12 3v18 M12 8l6-2 M12 13l8.5-2 M12 18l7-2",
  help: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18z M9.5 9.2a2.6 2.6 0 1 1 3.6 2.6c-.8.4-1.1.9-1.1 1.9 M12 17v.1",
  link: "M10 14a4 4 0 0 0 5.7 0l3-3a4 4 0 0 0-5.7-5.7l-1 1 M14 10a4 4 0 0 0-5.7 0l-3 3a4 4 0 0 0 5.7 5.7l1-1",
  save: "M12 4v11 M7.5 10.5 12 15l4.5-4.5 M4 19h16",
  open: "M3 18V6h6l2 2h8v3 M3 18l3-7h16l-3 7z",
  shown: "M2 12s3.6-6.5 10-6.5S22 12 22 12s-3.6 6.5-10 6.5S2 12 2 12z M12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  hidden: "M2 12s3.6-6.5 10-6.5S22 12 22 12s-3.6 6.5-10 6.5S2 12 2 12z M4 20 20 4",
  copy: "M9 9h11v11H9z M15 9V4H4v11h5",
  remove: "M6 6l12 12 M18 6 6 18",
  reset: "M4 5v5h5 M4.6 10A8 8 0 1 1 4 13",
  add: "M12 5v14 M5 12h14",
  less: "M5 12h14",
  enlarge: "M14 4h6v6 M20 4l-7 7 M10 20H4v-6 M4 20l7-7",
};
const icon = name => drawn("svg", { viewBox: "0 0 24 24", class: "icon", "aria-hidden": "true" }, drawn("path", { d: ICONS[name] }));

// A button with an icon; what it does is said in words to those who do not see it, and on hovering.
function iconButton(name, label, onclick, attributes = {}) {
  return element("button", { type: "button", class: "quiet", "aria-label": label, title: label, onclick, ...attributes }, icon(name));
}

// Change what an icon button shows and says.
function relabel(button, name, label) {
  if (button.title === label) return;
  button.replaceChildren(icon(name));
  button.title = label;
  button.setAttribute("aria-label", label);
}

// Hand the reader a file; nothing leaves this machine, and only the browser writes.
function download(name, parts, type) {
  const address = URL.createObjectURL(new Blob(parts, { type }));
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// Put text on the clipboard; false where the browser does not let us.
async function copied(text) {
  try { await navigator.clipboard.writeText(text); return true; } catch { return false; }
}
