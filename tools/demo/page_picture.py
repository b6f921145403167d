"""Write README's picture of a web page in motion: its looks are chosen one after the other while the scene turns.

.venv/engine/bin/python -m karf_engine export-page PROJECT --out PAGE --single --look LOOK ...
.venv/engine/bin/python -m tools.demo.page_picture PAGE/index.html
"""

from __future__ import annotations

import argparse
import io
import math
import tempfile
from pathlib import Path

from PIL import Image

from ..window.browser import WEB, open_browser

PICTURE = WEB.parents[3] / "docs" / "images" / "page.webp"
SIZE, WIDTH = (1120, 700), 840  # of the browser, and of the picture
FRAMES, MILLISECONDS, QUALITY = 40, 100, 80
SWING = 0.5  # radians to both sides
TURN = """(async (angle) => {{
  const {{ controls }} = karf.orbit;
  karf.orbit.start();
  controls.rotateLeft(angle);
  for (let count = 0; count < 60; count++) controls.update();
  await karf.viewer.settled();
}})({angle})"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, help="its index.html")
    page = parser.parse_args().page.absolute().as_uri()
    pictures = []
    with tempfile.TemporaryDirectory() as folder, open_browser("chromium", Path(folder)) as browser:
        browser.open(page, *SIZE, dark=False)
        looks = browser.run("document.querySelectorAll('#looks input').length")
        for frame in range(FRAMES):
            browser.run(f"document.querySelectorAll('#looks input')[{frame * looks // FRAMES}].click()")
            browser.run(TURN.format(angle=SWING * math.sin(2 * math.pi * frame / FRAMES)))
            browser.shoot(Path(folder) / "frame.png")
            picture = Image.open(io.BytesIO((Path(folder) / "frame.png").read_bytes())).convert("RGB")
            pictures.append(picture.resize((WIDTH, WIDTH * SIZE[1] // SIZE[0]), Image.Resampling.LANCZOS))
    pictures[0].save(
        PICTURE, save_all=True, append_images=pictures[1:], duration=MILLISECONDS, loop=0, quality=QUALITY, method=6
    )
    print(PICTURE)


if __name__ == "__main__":
    main()
