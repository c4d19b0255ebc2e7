// Small helpers to make elements; texts become text nodes, never markup.

const SVG = "http://www.w3.org/2000/svg";

/** An element with properties, attributes (those with a dash, and `role`) and children. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.includes("-") || name === "role" || name === "for") element.setAttribute(name, value);
    else if (value !== undefined) element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export function draw(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

let groups = 0;

/** A group of options of which one is chosen: pairs of value and text. */
export function choices(legend, options, chosen, onchange) {
  const name = `choice-${groups++}`;
  const entries = options.map(([value, text]) => {
    const input = make("input", { type: "radio", name, value, checked: value === chosen, onchange: () => onchange(value) });
    return make("label", { className: "choice" }, input, make("span", {}, text));
  });
  const group = make("fieldset", { className: "choices" }, make("legend", {}, legend), make("div", {}, ...entries));
  group.choose = (value) => {
    for (const input of group.querySelectorAll("input")) input.checked = input.value === value;
  };
  return group;
}

/** A slider with its label and its value in words. */
export function slider(text, { min = 0, max = 1, step = 0.01, value = 0 }, words, oninput) {
  const output = make("output", {}, words(value));
  const input = make("input", { type: "range", min, max, step, value });
  input.addEventListener("input", () => {
    output.textContent = words(Number(input.value));
    oninput(Number(input.value));
  });
  const label = make("label", { className: "slider" }, make("span", {}, text), output, input);
  label.set = (changed) => {
    input.value = changed;
    output.textContent = words(Number(input.value));
  };
  return label;
}

export function button(text, onclick, properties = {}) {
  return make("button", { type: "button", onclick, ...properties }, text);
}
