"""A page in browsers: its colors are those of the engine, its link restores it, everyone can use it, failures say what to do."""

import base64
import json
import re
import shutil

import imageio.v3 as imageio
import numpy as np
import pytest
from numpy.testing import assert_allclose

import karf_engine as karf
from blender_tests.page.conftest import served
from karf_engine.capture.camera_paths import looking_at

LOADED = 60  # seconds: a generous bound, as software draws
SETTLED = "karf.viewer.settled()"
DIFFERENCE = 2 / 255  # of the mean of a frame
SIDE = 128  # pixels of compared frames
ONE_BROWSER = pytest.mark.parametrize("browser", ["chromium"], indirect=True)
PIXELS = """(() => {
  const { viewer } = karf, { width, height } = viewer.target, gl = viewer.renderer.getContext();
  const pixels = new Uint8Array(4 * width * height);
  viewer.render();
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return { width, height, data: btoa(pixels.reduce((text, each) => text + String.fromCharCode(each), "")) };
})()"""
FROM_CAMERA = """(async (matrix, side, look) => {
  const { viewer, looks } = karf;
  viewer.onFrame = () => {};
  viewer.camera.matrix.fromArray(matrix).decompose(viewer.camera.position, viewer.camera.quaternion, viewer.camera.scale);
  looks.choose(look);
  viewer.resize(side, side, 1);
  await viewer.settled();
})"""
RESTS = """(async () => {
  let last;
  do {
    last = String(karf.orbit);
    await new Promise((done) => setTimeout(done, 400));
  } while (last !== String(karf.orbit));
})()"""
STATE = "({state: document.body.dataset.state, said: document.getElementById('status').textContent})"


def content(pages):
    return json.loads((pages.folder / "page.json").read_text(encoding="utf-8"))


def click(browser, selector):
    browser.run(f"document.querySelector({selector!r}).click()")


def picture(browser):
    """The picture as drawn, [H, W, 3] of 255."""
    drawn = browser.run(PIXELS)
    pixels = np.frombuffer(base64.b64decode(drawn["data"]), np.uint8)
    return pixels.reshape(drawn["height"], drawn["width"], 4)[::-1, :, :3]


@pytest.fixture
def opened(browser, pages):
    """The browser with the page of the folder."""
    browser.open(pages.url)
    return browser


def test_page_loads_in_seconds_without_a_remark(browser, pages):
    seconds = browser.open(pages.url)
    print(f"{browser.name}: {content(pages)['splats']['count']:,} Gaussians loaded in {seconds:.1f} s")
    assert seconds < LOADED
    assert browser.run(STATE) == {"state": "ready", "said": ""}
    assert browser.tell("remarks") == []


def cameras_of(orbit, count):
    """Cameras around the orbit's center at the start's height and distance."""
    center, up, position = (np.array(orbit[name]) for name in ("center", "up", "position"))
    low, high = orbit["azimuth"] or (0, 2 * np.pi * (1 - 1 / count))
    focal = SIDE / 2 / np.tan(np.radians(orbit["field_of_view"]) / 2)
    for angle in np.linspace(low, high, count):
        across, along = position - center, up * ((position - center) @ up)
        turned = along + (across - along) * np.cos(angle) + np.cross(up, across) * np.sin(angle)
        pose = looking_at(center + turned, center, up)
        yield karf.Camera(SIDE, SIDE, focal, focal, SIDE / 2, SIDE / 2, pose)


def assert_colors_match(browser, pages):
    """Assert that each look looks as the engine renders it, from cameras around the center."""
    model, written = karf.load(pages.project, "cpu"), content(pages)
    edits = [model.edit()]
    for number, look in enumerate(written["looks"][1:]):
        file = pages.folder.parent / f"{number}.json"
        file.write_text(json.dumps(look["edit"]), encoding="utf-8")
        edits.append(karf.read_edit(file, model.palettes))
    means = []
    for camera in cameras_of(written["orbit"], 3):
        for number, edit in enumerate(edits):
            wanted = model.render_recolored(camera, edit)
            matrix = camera.camera_to_world.T.ravel().tolist()
            browser.run(f"{FROM_CAMERA}({matrix}, {SIDE}, {number})")
            shown = picture(browser) / 255
            means.append(np.abs(shown - wanted).mean())
            assert means[-1] <= DIFFERENCE, (camera.position, written["looks"][number]["name"])
            assert np.quantile(np.abs(shown - wanted), 0.99) <= 2 * DIFFERENCE
    print(f"{browser.name}: {len(means)} frames, mean difference {255 * np.mean(means):.2f} of 255")


def test_colors_are_those_of_the_engine_in_every_look(opened, pages):
    assert_colors_match(opened, pages)


def test_splats_of_another_program_have_the_colors_of_the_engine(browser, imported_page):
    browser.open(imported_page.url)
    assert browser.tell("remarks") == []
    assert_colors_match(browser, imported_page)


def test_link_restores_look_colors_and_view(opened, pages):
    name, swatch = content(pages)["objects"][0]["name"], content(pages)["objects"][0]["swatches"][1]
    click(opened, "#looks label:nth-child(2) input")
    opened.run(
        "(() => { const input = document.querySelector('#colors input'); input.value = '#12ab34';"
        " input.dispatchEvent(new Event('input')); document.getElementById('view').focus(); })()"
    )
    opened.tell("press", keys=["ArrowLeft", "ArrowLeft", "ArrowUp", "+"])
    state = "({look: karf.looks.name, colors: karf.looks.colorsOf(NAME), at: karf.viewer.camera.position.toArray()})"
    state = state.replace("NAME", json.dumps(name))
    opened.run(RESTS)
    shown, link = opened.run(state), opened.run("karf.looks.address()")
    assert_allclose(shown["colors"][swatch["index"]], np.array([0x12, 0xAB, 0x34]) / 255)
    assert np.linalg.norm(np.array(shown["at"]) - content(pages)["orbit"]["position"]) > 0.01
    opened.open(link)
    restored = opened.run(state)
    assert restored["look"] == shown["look"] != "Original"
    assert_allclose(restored["colors"], shown["colors"])
    assert_allclose(restored["at"], shown["at"], rtol=1e-4, atol=1e-4)


@ONE_BROWSER
def test_view_of_a_link_stays_where_photos_were_taken(browser, pages):
    browser.open(f"{pages.url}#view=0+0+1e9&look=Unknown&color=1+12ab34+nobody")
    orbit = content(pages)["orbit"]
    away = np.array(browser.run("karf.viewer.camera.position.toArray()")) - orbit["center"]
    distance = np.linalg.norm(away)
    assert orbit["distance"][0] - 1e-3 <= distance <= orbit["distance"][1] + 1e-3
    assert orbit["polar"][0] - 1e-3 <= np.arccos(away @ orbit["up"] / distance) <= orbit["polar"][1] + 1e-3
    assert browser.run("karf.looks.name") == "Original"


@ONE_BROWSER
def test_chosen_look_is_an_edit_that_the_engine_reads(opened, pages, tmp_path):
    click(opened, "#looks label:nth-child(2) input")
    opened.run("karf.looks.change(karf.looks.page.objects[0].name, 1, '#12ab34')")
    click(opened, "#choose")
    text = opened.run("fetch(document.getElementById('edit').href).then((answer) => answer.text())")
    (tmp_path / "edit.json").write_text(text, encoding="utf-8")
    edit = karf.read_edit(tmp_path / "edit.json", karf.load(pages.project, "cpu").palettes)
    first = content(pages)["objects"][0]["name"]
    assert_allclose(edit.colors[first][1], np.array([0x12, 0xAB, 0x34]) / 255)
    assert "#12ab34" in opened.run("document.getElementById('summary').value")


@ONE_BROWSER
def test_locked_swatches_are_not_offered(opened, pages):
    offered = opened.run("document.querySelectorAll('#colors input').length")
    locked = [swatch["locked"] for each in content(pages)["objects"] for swatch in each["swatches"]]
    assert offered == locked.count(False) < len(locked) - len(content(pages)["objects"])


@ONE_BROWSER
def test_compare_shows_the_capture_left_of_the_line(opened):
    click(opened, "#looks label:nth-child(3) input")
    click(opened, "#compare")

    def with_line_at(place):
        opened.run(
            f"(() => {{ const wipe = document.getElementById('wipe'); wipe.value = {place}; wipe.oninput(); }})()"
        )
        opened.run(SETTLED)
        return picture(opened)

    captured, half, edited = map(with_line_at, (1, 0.5, 0))
    middle = half.shape[1] // 2
    assert (captured != edited).any()
    assert_allclose(half[:, : middle - 1], captured[:, : middle - 1])
    assert_allclose(half[:, middle + 1 :], edited[:, middle + 1 :])


SAVED = """new Promise((done) => {
  HTMLAnchorElement.prototype.click = function () {
    fetch(this.href).then((answer) => answer.blob()).then((blob) => {
      const reader = new FileReader();
      reader.onload = () => done({ name: this.download, data: reader.result.split(",")[1] });
      reader.readAsDataURL(blob);
    });
  };
  document.getElementById("save").onclick();
})"""


def test_saved_picture_is_what_the_view_shows(opened):
    click(opened, "#looks label:nth-child(2) input")
    opened.run(SETTLED)
    saved, shown = opened.run(SAVED), picture(opened)
    pixels = imageio.imread(base64.b64decode(saved["data"]), extension=".png")[..., :3]
    assert saved["name"] == "Still life Berry.png"
    assert_allclose(pixels.astype(float), shown, atol=1)


@ONE_BROWSER
def test_full_screen_shows_the_view_alone_and_comes_back(opened):
    is_full = "document.fullscreenElement?.id ?? ''"
    opened.run("document.getElementById('full').focus()")
    for shown in ("stage", ""):
        opened.tell("press", keys=["Enter"])
        opened.run("new Promise((done) => setTimeout(done, 500))")
        assert opened.run(is_full) == shown


@ONE_BROWSER
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
@pytest.mark.parametrize("dark", [False, True])
def test_everyone_can_use_it(browser, pages, size, dark, tmp_path):
    browser.open(pages.url, *size, dark=dark)
    browser.shoot(tmp_path / f"{size[0]}_{dark}.png")
    assert browser.tell("judge") == []
    click(browser, "#compare")
    click(browser, "#choose")
    assert browser.tell("judge") == []
    assert browser.run("document.documentElement.scrollWidth") <= size[0]


def test_page_of_one_file_opens_without_a_server(browser, pages):
    browser.open(pages.single)
    assert browser.run(STATE) == {"state": "ready", "said": ""}
    click(browser, "#looks label:nth-child(2) input")
    browser.run("new Promise((done) => setTimeout(done, 500))")
    assert browser.run("document.querySelector('#looks img').naturalWidth") > 0
    assert "look=" in browser.run("location.hash")
    assert browser.tell("remarks") == []


NO_WEBGL = """{ const original = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : original.call(this, kind, ...rest); }; }"""


@ONE_BROWSER
def test_stills_are_shown_without_webgl(browser, pages):
    browser.open(pages.url, before=NO_WEBGL)
    click(browser, "#looks label:nth-child(2) input")
    shown = browser.run(STATE)
    assert shown["state"] == "stills" and "WebGL 2" in shown["said"]
    still = content(pages)["looks"][1]["still"]
    assert browser.run("document.getElementById('still').src").endswith(still)
    assert browser.tell("judge") == []


@ONE_BROWSER
@pytest.mark.parametrize("damage", ["cut", "missing", "other"])
@pytest.mark.parametrize("pattern", ["scene.*", "weights_0.bin.gz", "page.json"])
def test_damaged_file_gets_a_sentence(browser, pages, pattern, damage, tmp_path):
    shutil.copytree(pages.folder, tmp_path / "page")
    [path] = (tmp_path / "page").glob(pattern)
    data = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(data[: len(data) // 2] if damage == "cut" else b"not what it was")
    with served(tmp_path / "page") as url:
        browser.open(url)
        shown = browser.run(STATE)
    assert shown["state"] == "stills"
    assert re.search(rf"The file {re.escape(path.name)} of this page (is damaged|could not be loaded)", shown["said"])
