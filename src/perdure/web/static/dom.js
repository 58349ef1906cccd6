// Making elements, and the few icons.

export function h(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(made.style, value);
    else if (name === "value") made.value = value;
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.flat(3).filter((one) => one !== null && one !== undefined && one !== false));
  return made;
}

export const byId = (id) => document.getElementById(id);

export function put(place, ...children) {
  place.replaceChildren(...children.flat(3).filter((one) => one !== null && one !== undefined && one !== false));
}

const PATHS = {
  play: "M5 3.5v9l7.5-4.5z",
  pause: "M4.5 3.5h2.5v9H4.5zM9 3.5h2.5v9H9z",
  back: "M11 3.5v9L5 8zM4 3.5h1.2v9H4z",
  ahead: "M5 3.5v9L11 8zM10.8 3.5H12v9h-1.2z",
  first: "M12 3.5v9L7 8zM7 3.5v9L2 8z",
  last: "M4 3.5v9L9 8zM9 3.5v9L14 8z",
  undo: "M6 3 2.5 6.2 6 9.4V7.2h3.2a2.4 2.4 0 1 1 0 4.8H5v1.4h4.2a3.8 3.8 0 1 0 0-7.6H6z",
  redo: "M10 3l3.5 3.2L10 9.4V7.2H6.8a2.4 2.4 0 1 0 0 4.8H11v1.4H6.8a3.8 3.8 0 1 1 0-7.6H10z",
  theme: "M8 2.5a5.5 5.5 0 1 0 0 11zM8 1.2a6.8 6.8 0 1 1 0 13.6A6.8 6.8 0 0 1 8 1.2z",
};

export function icon(name) {
  const drawn = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  drawn.setAttribute("viewBox", "0 0 16 16");
  drawn.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", PATHS[name]);
  path.setAttribute("fill", "currentColor");
  drawn.append(path);
  return drawn;
}

let toastTimer = 0;
export function toast(text, { bad = false, action = null } = {}) {
  const button = action && h("button", { onclick: () => { put(byId("toasts")); action.run(); } }, action.label);
  put(byId("toasts"), h("div", { class: `toast${bad ? " bad" : ""}`, role: bad ? "alert" : "status" }, h("span", {}, text), button));
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => put(byId("toasts")), bad ? 9000 : 6000);
}
