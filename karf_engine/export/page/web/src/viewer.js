/** The picture: Gaussians by Spark on three.js, with the rules of our own rasterizer (splats/kernels). */
import { ExtSplats, SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import * as THREE from "three";
import { FullScreenQuad } from "three/examples/jsm/postprocessing/Pass.js";
import { damaged } from "./files.js";
import { restoreHarmonics } from "./harmonics.js";
import { Recoloring } from "./recoloring.js";

const LEAST_ALPHA = 1 / 255;
const FRAGMENT = `
  precision highp float;
  in vec4 vRgba;
  in vec2 vSplatUv;
  out vec4 color;
  void main() {
    float alpha = vRgba.a * exp(-0.5 * dot(vSplatUv, vSplatUv));
    if (alpha < ${LEAST_ALPHA}) discard;
    alpha = min(alpha, 0.99);
    color = vec4(vRgba.rgb * alpha, alpha);
  }`;
const SHOW = {
  vertexShader: "void main() { gl_Position = vec4(position, 1.0); }",
  fragmentShader: `
    uniform sampler2D picture;
    void main() {
      vec3 color = texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb;
      gl_FragColor = vec4((floor(255.0 * color + 0.5) + 0.25) / 255.0, 1.0); // the same where drivers cut off and round
    }`,
};

/** A scene of Gaussians in one look. */
class Layer {
  /**
   * @param {THREE.WebGLRenderer} renderer
   * @param {object} facts `splats` of page.json
   * @param {ExtSplats} splats
   * @param {Float32Array | null} seen
   * @param {() => void} onDirty
   */
  constructor(renderer, facts, splats, seen, onDirty) {
    const { blur, min_area_ratio } = facts.screen_filter;
    const compensates = min_area_ratio < 1;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color().setRGB(...facts.background);
    this.spark = new SparkRenderer({
      renderer,
      onDirty,
      accumExtSplats: true, // colors in half floats, centers in floats
      sortRadial: false,
      enableLod: false,
      minAlpha: LEAST_ALPHA,
      maxStdDev: Math.sqrt(-2 * Math.log(LEAST_ALPHA)),
      maxPixelRadius: 1e5,
      preBlurAmount: compensates ? 0 : blur,
      blurAmount: compensates ? blur : 0,
      fragmentShader: FRAGMENT,
    });
    const { material } = this.spark;
    const limit = "max(0.0, detOrig / det)";
    if (!material.vertexShader.includes(limit)) throw new Error("Spark's shader is of an unknown version");
    material.vertexShader = material.vertexShader.replace(limit, `max(${min_area_ratio.toExponential()}, detOrig / det)`);
    this.mesh = new SplatMesh({ extSplats: splats, editable: false, raycastable: false });
    this.recoloring = new Recoloring(this.mesh, splats, seen, facts.n_background);
    this.scene.add(this.spark, this.mesh);
  }
}

/** Draws the scene in a look, and left of a line as captured. */
export class Viewer {
  /**
   * Throws without WebGL2.
   * @param {HTMLCanvasElement} canvas
   * @param {object} page content of page.json
   */
  constructor(canvas, page) {
    this.page = page;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, depth: false, stencil: false });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // Gaussians are sRGB already: nothing is converted
    const { near, unit } = page.splats;
    this.camera = new THREE.PerspectiveCamera(page.orbit.field_of_view, 1, near, Math.max(1e5 * near, 1e3 * unit));
    this.camera.up.set(...page.orbit.up);
    // sums of many faint Gaussians need more than 8 bits
    const isFloat = this.renderer.extensions.has("EXT_color_buffer_float");
    this.target = new THREE.WebGLRenderTarget(1, 1, {
      type: isFloat ? THREE.HalfFloatType : THREE.UnsignedByteType,
      depthBuffer: false,
      magFilter: THREE.NearestFilter,
      minFilter: THREE.NearestFilter,
    });
    this.quad = new FullScreenQuad(new THREE.ShaderMaterial({ ...SHOW, uniforms: { picture: { value: this.target.texture } } }));
    this.wipe = 0; // share of the width, from the left, that shows the scene as captured
    this.onFrame = () => {};
    this.waiting = false;
  }

  /**
   * @param {Uint8Array} fileBytes of the splats
   * @param {Float32Array | null} seen
   */
  async load(fileBytes, seen) {
    const { file, count } = this.page.splats;
    this.seen = seen;
    this.splats = new ExtSplats({ fileBytes, fileName: file });
    try {
      await this.splats.initialized;
      if (this.splats.numSplats !== count) throw damaged(file);
      await restoreHarmonics(this.splats, fileBytes);
    } catch {
      throw damaged(file);
    }
    this.edited = this.layer();
  }

  layer() {
    return new Layer(this.renderer, this.page.splats, this.splats, this.seen, () => this.draw());
  }

  /**
   * @param {number} width in pixels of the page
   * @param {number} height
   * @param {number} ratio pixels of the screen for one of the page
   */
  resize(width, height, ratio) {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    this.target.setSize(size.x, size.y);
    // portraits are as wide as the photos are high
    const { field_of_view } = this.page.orbit;
    const tangent = Math.tan((field_of_view * Math.PI) / 360) * Math.max(1, height / width);
    this.camera.fov = (Math.atan(tangent) * 360) / Math.PI;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Draw with the next frame of the screen. */
  draw() {
    if (this.waiting || !this.edited) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.render();
      this.waiting = false; // Spark asks for a frame while it draws one
      this.onFrame();
    });
  }

  /** @returns {[Layer, number, number][]} layers with the columns of the target that show them: from, to */
  parts() {
    const { width } = this.target;
    const border = Math.round(this.wipe * width);
    if (border) this.captured ??= this.layer();
    return [[this.captured, 0, border], [this.edited, border, width]].filter(([, from, to]) => from < to);
  }

  render() {
    const { width, height } = this.target;
    this.camera.updateMatrixWorld();
    for (const [layer, from, to] of this.parts()) {
      layer.spark.clipXY = 1 + (0.6 * Math.max(width, height)) / Math.min(width, height);
      this.target.scissor.set(from, 0, to - from, height);
      this.target.scissorTest = true;
      this.renderer.setRenderTarget(this.target);
      this.renderer.render(layer.scene, this.camera);
    }
    this.renderer.setRenderTarget(null);
    this.quad.render(this.renderer);
  }

  /** Wait until the picture is that of the current camera and look: Gaussians are sorted after they are first drawn. */
  async settled() {
    const isBusy = ([{ spark }]) => spark.sorting || spark.sortDirty || spark.dirty || !spark.activeSplats;
    do await new Promise(requestAnimationFrame);
    while (this.waiting || this.parts().some(isBusy));
  }
}
