"""A stand-in for the viewer's bundle, which Node builds, and a project of imported splats."""

import pytest

import karf_engine as karf
from blender_tests.engine.conftest import QUICK
from karf_engine.capture.training_images import read_photo_of_view
from karf_engine.export import page
from karf_engine.io.images import write_png
from karf_engine.splats.formats.splat_file import SplatFile

INDEX = '<!doctype html><head><title>-</title></head><body><script type="module" src="page.js"></script></body>'
SCRIPT = 'console.log("</script>", "<!--", "\\u00fc");\n'


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    """The folder of the stand-in, in place of the bundle."""
    folder = tmp_path_factory.mktemp("bundle")
    for name, text in (("index.html", INDEX), ("page.js", SCRIPT), ("licenses.txt", "MIT\n")):
        (folder / name).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "BUNDLE", folder)
        yield folder


@pytest.fixture(scope="session")
def imported(learned, tmp_path_factory):
    """The project of splats as another program writes them, with the red ball marked in a view of them."""
    from karf_engine.splats.formats import ply

    folder = tmp_path_factory.mktemp("imported")
    ply.write(folder / "theirs.ply", SplatFile(karf.load(learned.project, "cpu").splats.table))
    karf.import_splat(folder / "theirs.ply", folder / "capture", views=6, size=64, up="z")
    view = karf.open_capture(folder / "capture").views[0]
    color = read_photo_of_view(view)
    write_png(folder / "masks" / "ball" / f"{view.name}.png", color[..., 0] > 2 * color[..., 2])
    karf.learn(folder / "capture", folder / "masks", project=folder / "project", overrides=QUICK, threads=1)
    return folder / "project"
