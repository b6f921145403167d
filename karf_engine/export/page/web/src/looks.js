/** What is shown: a look of the page, and the colors that the reader has changed in it. */
import { damaged } from "./files.js";

/**
 * Return a color as a color input writes it.
 * @param {number[]} color sRGB, above 1 brighter than white
 */
export function toHex(color) {
  return `#${color.map((value) => Math.round(255 * Math.min(Math.max(value, 0), 1)).toString(16).padStart(2, "0")).join("")}`;
}

/**
 * @param {string} text #rrggbb
 * @returns {number[]} sRGB
 */
function fromHex(text) {
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
}

export class Looks {
  /** @param {object} page content of page.json */
  constructor(page) {
    if (page?.schema !== "karf-page/1" || !page.looks?.length) throw damaged("page.json");
    this.page = page;
    this.number = 0;
    /** @type {Map<string, Map<number, string>>} changed colors by object and swatch */
    this.changed = new Map();
    this.onChange = () => {};
    this.address = () => location.href; // of what is shown
  }

  get look() {
    return this.page.looks[this.number];
  }

  get name() {
    return this.changed.size ? `${this.look.name} (changed)` : this.look.name;
  }

  /** @param {number} number */
  choose(number) {
    this.number = number;
    this.changed.clear();
    this.onChange();
  }

  /**
   * @param {string} object
   * @param {number} index of the swatch
   * @param {string} color #rrggbb
   */
  change(object, index, color) {
    if (!this.changed.has(object)) this.changed.set(object, new Map());
    this.changed.get(object).set(index, color);
    this.onChange();
  }

  /**
   * Return the colors of an object as shown, sRGB [M, 3].
   * @param {string} object
   */
  colorsOf(object) {
    const changed = this.changed.get(object);
    return this.look.colors[object].map((color, index) => (changed?.has(index) ? fromHex(changed.get(index)) : color));
  }

  /** Return the difference of all colors to the learned ones in the order of the look's variant. */
  changes() {
    const { objects } = this.page.variants[this.look.variant];
    return new Float32Array(
      objects.flatMap(({ name, learned }) => {
        const colors = this.colorsOf(name);
        return learned.flatMap((color, index) => color.map((value, channel) => colors[index][channel] - value));
      }),
    );
  }

  /** Return the content of an edit.json. */
  edit() {
    const edit = structuredClone(this.look.edit);
    for (const [object, changed] of this.changed) {
      for (const [index, color] of changed) edit.objects[object].colors[index] = fromHex(color);
    }
    return edit;
  }

  /** Return name and colors as text. */
  summary() {
    const lines = this.page.objects.map(({ name }) => `${name}: ${this.colorsOf(name).slice(1).map(toHex).join(" ")}`);
    return [`${this.page.title}: ${this.name}`, ...lines].join("\n");
  }

  /**
   * Write what is shown into the parameters of a link.
   * @param {URLSearchParams} link
   */
  write(link) {
    if (this.number || this.changed.size) link.set("look", this.look.name);
    for (const [object, changed] of this.changed) {
      for (const [index, color] of changed) link.append("color", `${index} ${color.slice(1)} ${object}`);
    }
  }

  /**
   * Show what the parameters of a link say; unknown ones are ignored.
   * @param {URLSearchParams} link
   */
  read(link) {
    this.number = Math.max(0, this.page.looks.findIndex(({ name }) => name === link.get("look")));
    this.changed.clear();
    for (const text of link.getAll("color")) {
      const [, index, color, name] = text.match(/^(\d+) ([0-9a-f]{6}) (.+)$/s) ?? [];
      const swatch = this.page.objects.find((object) => object.name === name)?.swatches[index];
      if (swatch && !swatch.locked) {
        if (!this.changed.has(name)) this.changed.set(name, new Map());
        this.changed.get(name).set(Number(index), `#${color}`);
      }
    }
    this.onChange();
  }
}
