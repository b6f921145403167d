"""A stand-in for the viewer's bundle, which Node builds."""

import pytest

from karf_engine.export import page

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
