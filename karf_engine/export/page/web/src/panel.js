/** The panel beside the picture: looks, colors, and what the reader takes along. */
import { addressOf } from "./files.js";
import { toHex } from "./looks.js";

/** @param {string} id */
export const element = (id) => document.getElementById(id);

/**
 * Make an element.
 * @param {string} kind
 * @param {object} values of its properties
 * @param {(Node | string)[]} children
 */
function make(kind, values = {}, ...children) {
  const made = Object.assign(document.createElement(kind), values);
  made.append(...children);
  return made;
}

/** @param {object} page content of page.json */
export function showHeading({ title, studio, logo }) {
  document.title = studio ? `${title} – ${studio}` : title;
  element("title").textContent = title;
  if (logo) element("studio").append(make("img", { src: addressOf(logo), alt: studio }));
  else element("studio").textContent = studio;
  element("view").setAttribute("aria-label", `${title}, a picture that turns`);
}

/**
 * Offer the looks.
 * @param {import("./looks.js").Looks} looks
 * @returns {() => void} shows which one is chosen
 */
export function showLooks(looks) {
  const inputs = looks.page.looks.map(({ name, still }, number) => {
    const input = make("input", { type: "radio", name: "look", onchange: () => looks.choose(number) });
    const image = make("img", { src: addressOf(still), alt: "", loading: "lazy" });
    document.querySelector("#looks .chips").append(make("label", {}, input, image, make("span", {}, name)));
    return input;
  });
  element("looks").hidden = inputs.length === 1;
  return () => {
    inputs[looks.number].checked = true;
  };
}

/**
 * Offer the colors that are not locked.
 * @param {import("./looks.js").Looks} looks
 * @returns {() => void} shows the current colors
 */
export function showColors(looks) {
  const inputs = [];
  for (const { name, swatches } of looks.page.objects) {
    const own = swatches.filter(({ locked }) => !locked);
    if (!own.length) continue;
    const row = make("div", { className: "swatches" });
    own.forEach(({ index }, place) => {
      const input = make("input", { type: "color", ariaLabel: `${name}, color ${place + 1}` });
      input.oninput = () => looks.change(name, index, input.value);
      inputs.push([input, name, index]);
      row.append(input);
    });
    document.querySelector("#colors .objects").append(make("fieldset", {}, make("legend", {}, name), row));
  }
  element("colors").hidden = !inputs.length;
  element("compare").hidden = !inputs.length && looks.page.looks.length === 1;
  element("undo").onclick = () => {
    looks.choose(looks.number);
    element("colors").querySelector("input").focus();
  };
  return () => {
    for (const [input, name, index] of inputs) input.value = toHex(looks.colorsOf(name)[index]);
    element("undo").hidden = !looks.changed.size;
  };
}

/**
 * Let the reader choose the look, and copy a link to it.
 * @param {import("./looks.js").Looks} looks
 */
export function showChoice(looks) {
  element("choose").onclick = async () => {
    element("chosen-title").textContent = looks.name;
    element("summary").value = looks.summary();
    const file = new Blob([JSON.stringify(looks.edit(), null, 1)], { type: "application/json" });
    Object.assign(element("edit"), { href: URL.createObjectURL(file), download: `${fileName(looks)}.json` });
    element("chosen").showModal();
    const whom = looks.page.studio || "the sender of this page";
    element("chosen-text").textContent = (await copy(looks.summary()))
      ? `Name and colors are copied. Paste them into a message to ${whom}.`
      : `Send this to ${whom}:`;
  };
  element("close").onclick = () => element("chosen").close();
  element("chosen").onclose = () => URL.revokeObjectURL(element("edit").href);
  element("link").onclick = async () => {
    const address = looks.address();
    element("copied").textContent = (await copy(address)) ? "The link is copied." : address;
  };
}

/**
 * Return a name for files of what is shown, without characters that systems refuse.
 * @param {import("./looks.js").Looks} looks
 */
export function fileName(looks) {
  return `${looks.page.title} ${looks.name}`.replace(/[^\p{L}\p{N} ()_-]/gu, "").trim();
}

/**
 * Copy text, and return whether that succeeded: browsers allow it on https, loopback and in files.
 * @param {string} text
 */
function copy(text) {
  return navigator.clipboard?.writeText(text).then(() => true, () => false) ?? false;
}
