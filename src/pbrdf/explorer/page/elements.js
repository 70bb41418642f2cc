// Elements of the page.

// An element with attributes, listeners (onclick and the like) and children.
function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked" || key === "disabled" || key === "hidden") node[key] = value;
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat().filter(child => child !== null && child !== undefined));
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
const written = (value, digits = 3) => Number(value.toPrecision(digits)).toString().replace("-", "−");
