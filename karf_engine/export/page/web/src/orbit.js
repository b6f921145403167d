/** The viewpoint: around the center, where photos were taken, by mouse, touch and keys. */
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const TURN = 0.08; // radians of a key
const ZOOM = 0.92;

export class Orbit {
  /**
   * @param {import("./viewer.js").Viewer} viewer
   * @param {HTMLElement} element that is dragged
   * @param {object} facts `orbit` of page.json
   */
  constructor(viewer, element, facts) {
    this.viewer = viewer;
    this.facts = facts;
    this.controls = new OrbitControls(viewer.camera, element);
    const { controls } = this;
    controls.enablePan = false;
    controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    controls.dampingFactor = 0.12;
    controls.target.set(...facts.center);
    [controls.minPolarAngle, controls.maxPolarAngle] = facts.polar;
    [controls.minDistance, controls.maxDistance] = facts.distance;
    this.start();
    if (facts.azimuth) {
      const from = controls.getAzimuthalAngle();
      [controls.minAzimuthAngle, controls.maxAzimuthAngle] = facts.azimuth.map((angle) => from + angle);
    }
    controls.addEventListener("change", () => viewer.draw());
    viewer.onFrame = () => this.slowDown();
    const keys = {
      ArrowLeft: () => controls.rotateLeft(TURN),
      ArrowRight: () => controls.rotateLeft(-TURN),
      ArrowUp: () => controls.rotateUp(TURN),
      ArrowDown: () => controls.rotateUp(-TURN),
      "+": () => controls.dollyIn(ZOOM),
      "-": () => controls.dollyOut(ZOOM),
      Home: () => this.start(),
    };
    element.addEventListener("keydown", (event) => {
      const key = event.key === "=" ? "+" : event.key;
      if (!(key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
      keys[key]();
      event.preventDefault();
    });
  }

  /** Turn on after a drag; a camera that rests keeps its bits, so that nothing is drawn anew. */
  slowDown() {
    const { position, quaternion } = this.viewer.camera;
    const [before, turned] = [position.clone(), quaternion.clone()];
    if (this.controls.update()) return;
    position.copy(before);
    quaternion.copy(turned);
  }

  /** Go to the first view. */
  start() {
    this.viewer.camera.position.set(...this.facts.position);
    this.controls.update();
  }

  /** The viewpoint for a link. */
  toString() {
    return this.viewer.camera.position.toArray().map((value) => Number(value.toPrecision(6))).join(" ");
  }

  /**
   * Go to a viewpoint of a link, or to the nearest one allowed.
   * @param {string} text
   */
  read(text) {
    const position = text.split(" ").map(Number);
    if (position.length !== 3 || !position.every(Number.isFinite)) return;
    this.viewer.camera.position.set(...position);
    this.controls.update();
  }
}
