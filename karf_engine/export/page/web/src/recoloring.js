/**
 * Recoloring in Spark's shader graph: the edit of `bake_edit` in splatted_scene.py and the fading of `confidence_from`
 * in visibility.py, for each Gaussian and frame on the graphics card. An edit only replaces a small table of changes.
 */
import { dyno } from "@sparkjsdev/spark";
import * as THREE from "three";
import { damaged, readPacked } from "./files.js";

const WIDTH = 2048; // of textures with a texel per Gaussian or weight; every WebGL2 device has it
const ENOUGH = 2; // photos for full confidence, as in visibility.py

/**
 * Return a texture of whole rows that is read by texelFetch alone.
 * @param {Uint32Array | Float32Array} data
 * @param {number} channels 1 or 4
 * @param {number} width
 */
function texture(data, channels, width = WIDTH) {
  const rows = Math.max(1, Math.ceil(data.length / channels / width));
  const full = new data.constructor(rows * width * channels);
  full.set(data);
  const isWhole = data instanceof Uint32Array;
  const format = isWhole ? { 1: THREE.RedIntegerFormat, 4: THREE.RGBAIntegerFormat }[channels] : THREE.RGBAFormat;
  const made = new THREE.DataTexture(full, width, rows, format, isWhole ? THREE.UnsignedIntType : THREE.FloatType);
  if (isWhole) made.internalFormat = { 1: "R32UI", 4: "RGBA32UI" }[channels];
  made.needsUpdate = true;
  return made;
}

/** Palette weights of a variant's objects at the Gaussians. */
export class Weights {
  /**
   * @param {ArrayBuffer} data content of a file of weights
   * @param {{file: string, objects: {name: string, rows: number, colors: number}[]}} variant
   * @param {number} count of all Gaussians
   */
  constructor(data, variant, count) {
    const parts = [];
    const starts = new Uint32Array(count + 1); // of each Gaussian's weights
    let at = 0;
    for (const { rows, colors } of variant.objects) {
      const take = (kind, length) => {
        const taken = new kind(data.slice(at, at + length * kind.BYTES_PER_ELEMENT));
        at += taken.byteLength;
        return taken;
      };
      const numbers = take(Uint32Array, rows);
      const part = { numbers, colors, shares: take(Uint16Array, rows) };
      part.weights = take(Uint16Array, rows * colors);
      part.slopes = take(Uint16Array, rows * colors * 3);
      for (const number of numbers) {
        if (number >= count) throw damaged(variant.file);
        starts[number + 1] += colors;
      }
      parts.push(part);
    }
    for (let i = 0; i < count; i++) starts[i + 1] += starts[i];
    // halves stay as they are: weight and slope by red; by green and blue; place in the table of changes, and share
    const entries = new Uint32Array(4 * starts[count]);
    const free = starts.slice();
    let first = 0;
    for (const { numbers, colors, shares, weights, slopes } of parts) {
      numbers.forEach((number, row) => {
        for (let color = 0; color < colors; color++) {
          const from = row * colors + color;
          const to = 4 * free[number]++;
          entries[to] = weights[from] | (slopes[3 * from] << 16);
          entries[to + 1] = slopes[3 * from + 1] | (slopes[3 * from + 2] << 16);
          entries[to + 2] = (first + color) | (shares[row] << 16);
        }
      });
      first += colors;
    }
    this.starts = texture(starts, 1);
    this.entries = texture(entries, 4);
  }

  /**
   * Load a variant's weights.
   * @param {object} variant of page.json
   * @param {number} count of all Gaussians
   * @param {(received: number, expected: number) => void} [onBytes]
   */
  static async load(variant, count, onBytes) {
    const size = variant.objects.reduce((sum, { rows, colors }) => sum + rows * (6 + 8 * colors), 0);
    return new Weights(await readPacked(variant.file, size, onBytes), variant, count);
  }
}

/**
 * Return the photos' directions that show each Gaussian as a texture: mean direction, its length the confidence in the
 * color from there, and the widest angle.
 * @param {Float32Array} seen [n, 5] of seen.bin.gz
 * @param {number} n_background last rows, which every viewpoint may show
 */
function directions(seen, n_background) {
  const count = seen.length / 5;
  const data = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) {
    const known = Math.min(seen[5 * i + 4] / ENOUGH, 1);
    for (let k = 0; k < 3; k++) data[4 * i + k] = known * seen[5 * i + k];
    data[4 * i + 3] = seen[5 * i + 3];
    if (i >= count - n_background) data.set([1, 0, 0, Math.PI], 4 * i);
  }
  return texture(data, 4);
}

const RECOLOR = `
  vec3 recolor(vec3 shown, vec3 constant, int index, usampler2D starts, usampler2D entries, sampler2D changes) {
    int first = int(texelFetch(starts, ivec2(index % ${WIDTH}, index / ${WIDTH}), 0).r);
    int last = int(texelFetch(starts, ivec2((index + 1) % ${WIDTH}, (index + 1) / ${WIDTH}), 0).r);
    vec3 rest = shown - constant;
    for (int i = first; i < last; i++) {
      uvec4 entry = texelFetch(entries, ivec2(i % ${WIDTH}, i / ${WIDTH}), 0);
      vec2 weight = unpackHalf2x16(entry.x);
      float by = weight.x + dot(rest, vec3(weight.y, unpackHalf2x16(entry.y)));
      vec3 change = texelFetch(changes, ivec2(int(entry.z & 0xffffu), 0), 0).rgb;
      shown += unpackHalf2x16(entry.z).y * by * change;
    }
    return max(shown, vec3(0.0));
  }`;
const FADE = `
  vec3 fade(vec3 shown, vec3 center, vec3 eye, int index, sampler2D directions) {
    vec4 seen = texelFetch(directions, ivec2(index % ${WIDTH}, index / ${WIDTH}), 0);
    float known = length(seen.xyz);
    float angle = acos(clamp(dot(seen.xyz / max(known, 1e-6), normalize(eye - center)), -1.0, 1.0));
    known *= clamp((radians(40.0) - angle + seen.w) / radians(30.0), 0.0, 1.0);
    return mix(vec3(0.5), shown, known * known * (3.0 - 2.0 * known));
  }`;

/** The colors that a mesh of Gaussians shows: a look, faded where no photo shows it. */
export class Recoloring {
  /**
   * @param {import("@sparkjsdev/spark").SplatMesh} mesh
   * @param {import("@sparkjsdev/spark").ExtSplats} splats of the mesh
   * @param {Float32Array | null} seen
   * @param {number} n_background
   */
  constructor(mesh, splats, seen, n_background) {
    this.mesh = mesh;
    const nothing = texture(new Uint32Array(4), 4, 1);
    this.starts = new dyno.DynoUsampler2D({ key: "starts", value: texture(new Uint32Array(splats.numSplats + 1), 1) });
    this.entries = new dyno.DynoUsampler2D({ key: "entries", value: nothing });
    this.changes = new dyno.DynoSampler2D({ key: "changes", value: texture(new Float32Array(4), 4, 1) });
    const fades = seen && new dyno.DynoSampler2D({ key: "directions", value: directions(seen, n_background) });
    mesh.enableViewToObject = true;
    const { starts, entries, changes } = this;
    mesh.objectModifier = dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => {
      const { rgb, index, center } = dyno.splitGsplat(gsplat).outputs;
      const constant = dyno.splitGsplat(dyno.readExtSplat(splats.dyno, index)).outputs.rgb;
      let shown = call("recolor", RECOLOR, { rgb, constant, index, starts, entries, changes });
      if (fades) {
        const eye = mesh.context.viewToObject.translate;
        shown = call("fade", FADE, { shown, center, eye, index, directions: fades });
      }
      return { gsplat: dyno.combineGsplat({ gsplat, rgb: shown }) };
    });
    mesh.updateGenerator();
  }

  /**
   * Show a look.
   * @param {Weights} weights of its variant
   * @param {Float32Array} changes edited less learned sRGB of all objects' colors in the variant's order, [M, 3]
   */
  show(weights, changes) {
    const data = new Float32Array((4 * changes.length) / 3);
    for (let i = 0; i < changes.length / 3; i++) data.set(changes.subarray(3 * i, 3 * i + 3), 4 * i);
    this.changes.value.dispose();
    this.changes.value = texture(data, 4, Math.max(1, data.length / 4));
    this.starts.value = weights.starts;
    this.entries.value = weights.entries;
    this.mesh.updateVersion();
  }
}

/**
 * Return the result of a GLSL function of colors in Spark's shader graph.
 * @param {string} name
 * @param {string} source
 * @param {Record<string, object>} inputs in the order of its parameters
 */
function call(name, source, inputs) {
  const kinds = Object.fromEntries(Object.entries(inputs).map(([key, value]) => [key, value.type]));
  const made = new dyno.Dyno({
    inTypes: kinds,
    outTypes: { color: "vec3" },
    inputs,
    globals: () => [dyno.unindent(source)],
    statements: ({ inputs: names, outputs }) => [`${outputs.color} = ${name}(${Object.values(names).join(", ")});`],
  });
  return made.outputs.color;
}
