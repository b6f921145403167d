"""A web page of a scene: its files, its weights against the engine's own recoloring, and what is refused."""

import base64
import gzip
import json
import shutil
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

pytest.importorskip("numba")
pytest.importorskip("gsply")

import karf_engine as karf
from karf_engine.commands import export_page
from karf_engine.errors import BadRequest, Cancelled, DataError, MissingDependency
from karf_engine.export import page as page_module
from karf_engine.io import files as files_module
from karf_engine.palettes.palette import Edit, read_edit
from karf_engine.project import Project
from karf_engine.project.state import without_stage, write_state
from karf_engine.splats.formats.registry import read_splats
from karf_engine.splats.formats.splat_file import upright
from karf_engine.splats.gaussians import subset
from karf_engine.splats.kernels.arrays import C0, COLOR, PLAIN_FILTER
from karf_engine.splats.rasterizer import rasterize

pytestmark = pytest.mark.usefixtures("bundle")
LOOKS = ("blue", "added")


@pytest.fixture(scope="module")
def model(learned):
    return karf.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def edits(model):
    """A look of the learned swatches, and one with an added color and an edge."""
    added = model.edit().add_color("ball", "#c0221a", "#1ec040").edge("block", 1.0, 2.0).swatch("block", 1, "#20ff80")
    return {"blue": model.edit().becomes("ball", "#c0221a", "#3059b8"), "added": added}


@pytest.fixture(scope="module")
def files(edits, tmp_path_factory):
    """The files of the looks."""
    folder = tmp_path_factory.mktemp("looks")
    for name, edit in edits.items():
        karf.write_edit(folder / f"{name}.json", edit)
    return {name: folder / f"{name}.json" for name in edits}


def export(project, out, **options):
    karf.export_page(project, out, threads=1, **options)
    return out


def content(folder):
    return json.loads((folder / "page.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(learned, files, tmp_path_factory):
    """A page with both looks."""
    return export(learned.project, tmp_path_factory.mktemp("page") / "page", looks=list(files.values()))


@pytest.fixture(scope="module")
def exact(learned, files, tmp_path_factory):
    """The same page with a file that keeps every bit of the Gaussians."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "SPLATS", "scene.ply")
        return export(learned.project, tmp_path_factory.mktemp("exact") / "page", looks=list(files.values()))


def shown_rows(folder, model):
    """The rows of the model's Gaussians in an exact page."""
    numbers = {row.tobytes(): number for number, row in enumerate(model.splats.table)}
    return np.array([numbers[row.tobytes()] for row in read_splats(folder / "scene.ply").table])


# ----------------------------------------------------------------------------------------------------------- its files
def test_page_has_the_files_that_it_names(page):
    found = content(page)
    assert found["schema"] == "karf-page/1"
    named = {found["splats"]["file"], found["seen"], *(each["file"] for each in found["variants"])}
    stills = {look["still"] for look in found["looks"]}
    written = {path.relative_to(page).as_posix() for path in page.rglob("*") if path.is_file()}
    assert written == named | stills | {"index.html", "page.js", "page.json", "licenses.txt"}
    assert {Image.open(page / still).size for still in stills} == {(480, 360)}


def test_splat_file_has_the_axes_of_the_capture(page, exact):
    in_world = upright(read_splats(page / "scene.spz").table)
    assert_allclose(in_world[:, :3], read_splats(exact / "scene.ply").table[:, :3], atol=1e-3)


def test_numbers_of_the_renderer_are_the_scenes_own(page, model):
    found, splats = content(page)["splats"], model.splats
    assert found["count"] == len(read_splats(page / "scene.spz"))
    assert found["n_background"] == splats.n_background
    assert tuple(found["screen_filter"].values()) == splats.screen_filter
    assert (found["near"], tuple(found["background"])) == (splats.near, splats.background)


def test_only_gaussians_that_change_no_photo_are_left_out(exact, model):
    rows = shown_rows(exact, model)
    background = np.arange(model.splats.n_foreground, len(model.splats))
    assert len(rows) < len(model.splats) and set(background) <= set(rows)
    shown = subset(model.splats, rows)
    for view in model.capture.views:
        change = rasterize(shown, view.camera).image[..., :3] - rasterize(model.splats, view.camera).image[..., :3]
        assert np.abs(change).mean() < 1 / 255


def test_visibility_is_that_of_the_shown_gaussians(exact, model):
    seen = np.frombuffer(gzip.decompress((exact / "seen.bin.gz").read_bytes()), "<f4").reshape(-1, 5)
    assert_array_equal(seen, model.splats.visibility[shown_rows(exact, model)])


def test_nothing_fades_where_the_setting_says_so(learned, tmp_path):
    out = export(learned.project, tmp_path / "page", overrides=["render.unseen=shown"])
    assert content(out)["seen"] is None and not (out / "seen.bin.gz").exists()


# ---------------------------------------------------------------------------------------------------------- recoloring
def objects_in(folder, variant):
    """The rows, shares, weights and slopes of each object, as docs/files.md describes the file."""
    data, at = gzip.decompress((folder / variant["file"]).read_bytes()), 0
    for entry in variant["objects"]:
        arrays, m = [], entry["colors"]
        for kind, shape in (("<u4", ()), ("<f2", ()), ("<f2", (m,)), ("<f2", (m, 3))):
            count = entry["rows"] * int(np.prod(shape, dtype=int))
            arrays.append(np.frombuffer(data, kind, count, at).reshape(entry["rows"], *shape))
            at += arrays[-1].nbytes
        yield entry, *(array.astype(int if array.dtype == "<u4" else np.float32) for array in arrays)
    assert at == len(data)


@pytest.mark.parametrize("name", ["Original", *LOOKS])
def test_weights_recolor_as_the_engine(exact, model, edits, name):
    found = content(exact)
    look = next(look for look in found["looks"] if look["name"] == name)
    table = read_splats(exact / "scene.ply").table.copy()
    own = table[:, COLOR:].reshape(len(table), -1, 3)
    recolored = own.copy()
    for entry, rows, shares, weights, slopes in objects_in(exact, found["variants"][look["variant"]]):
        change = np.float32(look["colors"][entry["name"]]) - np.float32(entry["learned"])
        recolored[rows, 0] += shares[:, None] * (weights @ change) / C0
        matrix = shares[:, None, None] * np.einsum("nmi,mj->nij", slopes, change)
        recolored[rows, 1:] += own[rows, 1:] @ matrix
    table[:, COLOR:] = recolored.reshape(len(table), -1)
    wanted = model.recolored_splats(edits.get(name, model.edit()))
    shown = subset(wanted, shown_rows(exact, model))
    for view in model.capture.split("test"):
        colors = [rasterize(each, view.camera).picture() for each in (replace(shown, table=table), shown)]
        assert np.abs(colors[0] - colors[1]).max() <= 1 / 255


def test_looks_of_the_same_added_colors_and_edges_share_weights(page, learned, files, tmp_path):
    assert [look["variant"] for look in content(page)["looks"]] == [0, 0, 1]
    again = export(learned.project, tmp_path / "again", looks=[files["added"]])
    assert len(content(again)["variants"]) == 2


def test_look_keeps_its_edit(page, model, edits, tmp_path):
    for look in content(page)["looks"]:
        (tmp_path / "edit.json").write_text(json.dumps(look["edit"]))
        read, wanted = read_edit(tmp_path / "edit.json", model.palettes), edits.get(look["name"], model.edit())
        assert all(np.array_equal(read.colors[name], wanted.colors[name]) for name in model.objects)
        assert (read.edges, read.added.keys()) == (wanted.edges, wanted.added.keys())


# --------------------------------------------------------------------------------------------------------------- looks
def test_looks_are_the_original_then_files_then_the_sheet(learned, files, tmp_path):
    (tmp_path / "sheet.csv").write_text("colorway,object,hex\nSea,ball,#1040d0\nRust,ball,#b04010\n")
    out = export(learned.project, tmp_path / "page", looks=[files["blue"]], sheet=tmp_path / "sheet.csv")
    assert [look["name"] for look in content(out)["looks"]] == ["Original", "blue", "Sea", "Rust"]


def test_locked_swatches_are_not_offered(learned, tmp_path):
    found = content(export(learned.project, tmp_path / "page", locked=["ball/1"]))
    locked = {(own["name"], each["index"]) for own in found["objects"] for each in own["swatches"] if each["locked"]}
    assert locked == {("ball", 0), ("block", 0), ("ball", 1)}


def test_heading_is_text_and_the_default_is_the_project(learned, tmp_path):
    out = export(learned.project, tmp_path / "page", title="Pots </title><b>", studio="Us & co")
    assert "<title>Pots &lt;/title&gt;&lt;b&gt;</title>" in (out / "index.html").read_text()
    assert (content(out)["title"], content(out)["studio"]) == ("Pots </title><b>", "Us & co")
    assert content(export(learned.project, out))["title"] == "project"


# --------------------------------------------------------------------------------------------------------- single file
class Scripts(HTMLParser):
    """The scripts of a page, as a browser would find them, and the text outside of them."""

    def __init__(self, text):
        super().__init__()
        self.found, self.outside, self._inside = [], "", False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "script":
            self._inside = True
            self.found.append((dict(attributes), ""))

    def handle_endtag(self, tag):
        self._inside = False

    def handle_data(self, data):
        if self._inside:
            self.found[-1] = (self.found[-1][0], self.found[-1][1] + data)
        else:
            self.outside += data


def test_single_file_has_all_others(page, learned, files, tmp_path, bundle):
    out = export(learned.project, tmp_path / "single", looks=list(files.values()), single=True, title="-")
    assert [path.name for path in out.iterdir()] == ["index.html"]
    (data, held), (script, code) = (parsed := Scripts((out / "index.html").read_text(encoding="utf-8"))).found
    assert data == {"type": "application/json", "id": "karf-files"} and script == {"type": "module"}
    assert parsed.outside.strip() == "-"
    assert code.replace("\\x3c", "<") == (bundle / "page.js").read_text(encoding="utf-8")
    written = {path.relative_to(page).as_posix(): path for path in page.rglob("*") if path.is_file()}
    held = {name: base64.b64decode(text) for name, text in json.loads(held).items()}
    assert held.keys() == written.keys() - {"index.html", "page.js"}
    assert all(data == written[name].read_bytes() for name, data in held.items() if name != "page.json")


# ------------------------------------------------------------------------------------------------------------ the rest
def test_too_many_gaussians_are_reduced_only_when_asked(learned, model, tmp_path, monkeypatch):
    monkeypatch.setattr(export_page, "MOST_GAUSSIANS", 1500)
    with pytest.raises(BadRequest, match="too many for a web page") as caught:
        export(learned.project, tmp_path / "page")
    assert "--reduce 1500" in str(caught.value.hint) and not (tmp_path / "page").exists()
    lines = []
    found = content(export(learned.project, tmp_path / "page", reduce=1200, progress=lines.append))
    assert found["splats"]["count"] == 1200 < len(model.splats)
    assert any("1,200 of" in line and "PSNR" in line for line in lines)


def test_missing_viewer_is_told_with_the_remedy(learned, tmp_path, monkeypatch):
    monkeypatch.setattr(page_module, "BUNDLE", tmp_path)
    with pytest.raises(MissingDependency, match=r"index\.html is missing") as caught:
        export(learned.project, tmp_path / "page")
    assert "tools/dev.py page" in caught.value.hint


def test_ended_export_leaves_the_old_page(learned, page, tmp_path):
    out = shutil.copytree(page, tmp_path / "page")
    with pytest.raises(Cancelled):
        export(learned.project, out, should_stop=iter([False] * 10 + [True] * 99).__next__)
    assert {path.name for path in tmp_path.iterdir()} == {"page"}
    assert (out / "page.json").read_bytes() == (page / "page.json").read_bytes()


def test_page_that_cannot_be_put_in_place_leaves_the_old_one(learned, page, tmp_path, monkeypatch):
    out, move = shutil.copytree(page, tmp_path / "page"), files_module.replace

    def refuse_new(source, target):
        if source.name == "new":
            raise PermissionError(13, "Permission denied", str(target))
        move(source, target)

    monkeypatch.setattr(files_module, "replace", refuse_new)
    with pytest.raises(DataError, match="page"):
        export(learned.project, out)
    assert {path.name for path in tmp_path.iterdir()} == {"page"}
    assert (out / "page.json").read_bytes() == (page / "page.json").read_bytes()


def test_new_page_replaces_the_old_one(learned, page, tmp_path):
    out = shutil.copytree(page, tmp_path / "page")
    export(learned.project, out, single=True)
    assert [path.name for path in out.iterdir()] == ["index.html"]


def test_folder_with_other_files_is_refused(learned, page, tmp_path):
    out = shutil.copytree(page, tmp_path / "page")
    (out / "CNAME").write_text("example.org")
    with pytest.raises(BadRequest, match="is not empty"):
        export(learned.project, out)
    assert (out / "CNAME").exists() and (out / "scene.spz").exists()


def test_full_disk_names_the_folder(learned, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(page_module, "_write_arrays", fail)
    with pytest.raises(DataError, match=f"{tmp_path.name}/page"):
        export(learned.project, tmp_path / "page")


LOGOS = {
    "logo.svg": '<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0h9"/></svg>',
    "script.svg": '<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>',
    "event.svg": '<svg xmlns="http://www.w3.org/2000/svg" onload="alert(1)"/>',
    "link.svg": '<svg xmlns="http://www.w3.org/2000/svg"><a href=" JavaScript:alert(1)"/></svg>',
    "entity.svg": '<!DOCTYPE svg [<!ENTITY a "b">]><svg xmlns="http://www.w3.org/2000/svg">&a;</svg>',
    "page.svg": "<html/>",
    "broken.png": "no picture",
    "logo.gif": "GIF89a",
    "large.svg": f"<svg>{' ' * (1 << 20)}</svg>",
}


def test_logo_is_copied(learned, tmp_path):
    (tmp_path / "Ours.SVG").write_text(LOGOS["logo.svg"])
    Image.new("RGB", (8, 8)).save(tmp_path / "ours.png")
    for name, wanted in (("Ours.SVG", "logo.svg"), ("ours.png", "logo.png")):
        out = export(learned.project, tmp_path / "page", logo=tmp_path / name)
        assert content(out)["logo"] == wanted
        assert (out / wanted).read_bytes() == (tmp_path / name).read_bytes()


@pytest.mark.parametrize("name", LOGOS.keys() - {"logo.svg"})
def test_unsafe_or_damaged_logo_is_refused(learned, tmp_path, name):
    (tmp_path / name).write_text(LOGOS[name])
    with pytest.raises(DataError, match=name) as caught:
        export(learned.project, tmp_path / "page", logo=tmp_path / name)
    assert caught.value.hint and not (tmp_path / "page").exists()


def test_looks_of_one_name_or_that_replace_colors_are_refused(learned, model, files, tmp_path):
    shutil.copyfile(files["blue"], tmp_path / "Original.json")
    with pytest.raises(BadRequest, match="Two looks are called 'Original'"):
        export(learned.project, tmp_path / "page", looks=[tmp_path / "Original.json"])
    karf.write_edit(tmp_path / "paper.json", Edit(model.edit().colors, "paper"))
    with pytest.raises(BadRequest, match="'paper' replaces colors"):
        export(learned.project, tmp_path / "page", looks=[tmp_path / "paper.json"])
    with pytest.raises(BadRequest, match="no swatch 9"):
        export(learned.project, tmp_path / "page", locked=["ball/9"])


def test_scene_without_palettes_has_one_look_and_no_swatches(learned, files, tmp_path):
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    write_state(project.state_file, without_stage(project.state(), "segmentation"))
    found = content(export(project.folder, tmp_path / "page"))
    assert [look["name"] for look in found["looks"]] == ["Original"] and found["objects"] == []
    with pytest.raises(BadRequest, match="recoloring"):
        export(project.folder, tmp_path / "other", looks=[files["blue"]])


def test_splats_of_another_program_are_shown_with_their_own_filter(imported, tmp_path):
    found = content(export(imported, tmp_path / "page"))
    assert tuple(found["splats"]["screen_filter"].values()) == tuple(map(float, PLAIN_FILTER))
    assert found["seen"] is None and found["looks"][0]["name"] == "Original"
