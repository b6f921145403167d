/** A page that shows a scene in its looks. */
import { FileError, addressOf, damaged, read, readJson, readPacked } from "./files.js";
import { Looks } from "./looks.js";
import { Orbit } from "./orbit.js";
import { element, fileName, showChoice, showColors, showHeading, showLooks } from "./panel.js";
import { Weights } from "./recoloring.js";
import { Viewer } from "./viewer.js";

const LINK_DELAY = 250; // milliseconds without a change
const SAVED = 60_000; // milliseconds after which a saved picture may be forgotten
const MOST_PIXELS = 2; // of the screen for one of the page

start().catch(showFailure);

async function start() {
  const page = await readJson("page.json");
  const looks = new Looks(page);
  showHeading(page);
  const updates = [showLooks(looks), showColors(looks), () => showStill(looks.look)];
  showChoice(looks);
  looks.onChange = () => updates.forEach((update) => update());
  const link = () => new URLSearchParams(location.hash.slice(1));
  looks.read(link());
  if (!document.createElement("canvas").getContext("webgl2")) {
    throw new FileError("This browser cannot draw in three dimensions (WebGL 2), so here are pictures of the looks.");
  }
  const viewer = new Viewer(element("view"), page);
  const weights = await load(page, viewer);
  const orbit = new Orbit(viewer, element("view"), page.orbit);
  const follow = followLink(looks, orbit);
  updates.push(() => {
    element("shown").textContent = looks.name;
    viewer.edited.recoloring.show(weights[looks.look.variant], looks.changes());
    viewer.draw();
    follow();
  });
  orbit.controls.addEventListener("change", follow);
  const restore = () => {
    looks.read(link());
    if (link().has("view")) orbit.read(link().get("view"));
    else orbit.start();
  };
  addEventListener("hashchange", restore);
  new ResizeObserver(([{ contentRect: { width, height } }]) => {
    if (width && height) viewer.resize(width, height, Math.min(devicePixelRatio, MOST_PIXELS));
  }).observe(element("stage"));
  showTools(viewer, orbit, looks);
  restore();
  element("view").addEventListener("webglcontextlost", () => {
    showFailure(new FileError("The graphics card has stopped drawing. Load this page again."));
  });
  await viewer.settled();
  setState("ready");
  globalThis.karf = { viewer, orbit, looks }; // for scripts of the page's host, and tests
}

/**
 * Load the scene, and return the weights of all variants.
 * @param {object} page
 * @param {Viewer} viewer
 */
async function load(page, viewer) {
  const { file, count } = page.splats;
  let received = 0;
  let expected = 0;
  const onBytes = (bytes, more) => {
    if (document.body.dataset.state !== "loading") return; // another file has failed
    received += bytes;
    expected += more;
    const share = Math.min(received / expected, 1);
    if (Number.isFinite(share)) element("progress").value = share;
    say(Number.isFinite(share) ? `Loading, ${10 * Math.floor(10 * share)} %` : "Loading");
  };
  const [bytes, seen, ...weights] = await Promise.all([
    read(file, onBytes),
    page.seen && readPacked(page.seen, 20 * count, onBytes),
    ...page.variants.map((variant) => Weights.load(variant, count, onBytes)),
  ]);
  await viewer.load(bytes, seen && new Float32Array(seen));
  return weights;
}

/**
 * Keep the page's address a link to what is shown; return what to call when that changes.
 * @param {Looks} looks
 * @param {Orbit} orbit
 */
function followLink(looks, orbit) {
  looks.address = () => {
    const link = new URLSearchParams();
    looks.write(link);
    link.set("view", String(orbit));
    history.replaceState(null, "", `#${link}`);
    return location.href;
  };
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(looks.address, LINK_DELAY);
  };
}

/**
 * @param {Viewer} viewer
 * @param {Orbit} orbit
 * @param {Looks} looks
 */
function showTools(viewer, orbit, looks) {
  const [compare, wipe, full] = ["compare", "wipe", "full"].map(element);
  const showWipe = () => {
    const isOn = compare.getAttribute("aria-pressed") === "true";
    wipe.hidden = element("tags").hidden = !isOn;
    viewer.wipe = isOn ? Number(wipe.value) : 0;
    viewer.draw();
  };
  compare.onclick = () => {
    compare.setAttribute("aria-pressed", String(compare.getAttribute("aria-pressed") !== "true"));
    showWipe();
    if (!wipe.hidden) wipe.focus();
  };
  wipe.oninput = showWipe;
  element("reset").onclick = () => orbit.start();
  element("save").onclick = () => {
    viewer.render();
    element("view").toBlob((picture) => {
      const link = Object.assign(document.createElement("a"), { download: `${fileName(looks)}.png` });
      link.href = URL.createObjectURL(picture);
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), SAVED);
    });
  };
  full.hidden = !document.fullscreenEnabled; // not on iPhones
  full.onclick = () => (document.fullscreenElement ? document.exitFullscreen() : element("stage").requestFullscreen());
  document.addEventListener("fullscreenchange", () => full.setAttribute("aria-pressed", String(!!document.fullscreenElement)));
}

/** @param {object} look of page.json */
function showStill({ still, name }) {
  Object.assign(element("still"), { src: addressOf(still), alt: name, hidden: false });
}

/** @param {"loading" | "ready" | "stills"} state */
function setState(state) {
  document.body.dataset.state = state;
  if (state === "ready") {
    element("still").hidden = true;
    say("");
  }
}

/** @param {string} text for all, and for screen readers at once */
function say(text) {
  if (element("status").textContent !== text) element("status").textContent = text;
}

/** @param {unknown} error */
function showFailure(error) {
  if (!(error instanceof FileError)) console.error(error);
  say(error instanceof FileError ? error.message : damaged("page.json").message);
  setState("stills");
}
