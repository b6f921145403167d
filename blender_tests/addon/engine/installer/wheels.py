"""Tiny wheels that stand for the engine's packages, and an index on this computer that serves them."""

import base64
import hashlib
import threading
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

TORCH = """
class _Sum(list):
    def sum(self):
        return 3.0
def ones(count):
    return _Sum()
class _Is:
    def __init__(self, **values):
        self.__dict__.update(values)
__version__ = "{version}"
version = _Is(cuda={cuda!r}, hip=None)
cuda = _Is(is_available=lambda: False)
backends = _Is(mps=_Is(is_available=lambda: False))
"""
MODULES = {  # package -> what is imported
    "numpy": "numpy",
    "scipy": "scipy",
    "safetensors": "safetensors",
    "filelock": "filelock",
    "imageio": "imageio",
    "pillow": "PIL",
    "opencv-python-headless": "cv2",
    "openexr": "OpenEXR",
    "numba": "numba",
}


def make(folder, name, version, files, tag="py3-none-any"):
    """Write a wheel; returns its path."""
    stem = f"{name.replace('-', '_')}-{version}"
    info = f"{stem}.dist-info"
    files = dict(files)
    files[f"{info}/METADATA"] = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: {tag}\n"
    rows = [f"{path},sha256={_hash(text)},{len(text.encode())}" for path, text in files.items()]
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    path = folder / f"{stem}-{tag}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for inside, text in files.items():
            entry = zipfile.ZipInfo(inside, (2026, 1, 1, 0, 0, 0))
            entry.external_attr = 0o100755 << 16  # a file that may be run
            archive.writestr(entry, text)
    return path


def make_torch(folder, version, cuda=None, tag="py3-none-any"):
    return make(folder, "torch", version, {"torch/__init__.py": TORCH.format(version=version, cuda=cuda)}, tag)


def locked(path, name, version):
    """What a lock file says of a wheel."""
    data = path.read_bytes()
    return f"# {path.name} {len(data)}\n{name}=={version} \\\n    --hash=sha256:{hashlib.sha256(data).hexdigest()}\n"


def _hash(text):
    return base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()


class Index:
    """A package index of a folder's wheels. `fetched` counts whole files by name; `holding` names one to hold back."""

    def __init__(self, folder):
        self.folder, self.fetched, self.begun = folder, [], threading.Event()
        self.holding, self.release = "", threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/simple"

    def close(self):
        self.release.set()
        self._server.shutdown()
        self._server.server_close()

    def _handler(index):
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                kind, name = self.path.strip("/").split("/")
                if kind == "simple":
                    stem = name.replace("-", "_")
                    found = [path.name for path in index.folder.glob(f"{stem}-*.whl")]
                    links = [f'<a data-core-metadata="true" href="/files/{file}">{file}</a>' for file in found]
                    self.answer(
                        "".join(["<!DOCTYPE html><html><body>", *links, "</body></html>"]).encode(), "text/html"
                    )
                elif name.endswith(".metadata"):
                    path = index.folder / name.removesuffix(".metadata")
                    info = "-".join(path.name.split("-")[:2]) + ".dist-info/METADATA"
                    self.answer(zipfile.ZipFile(path).read(info), "text/plain")
                else:
                    self.send_wheel(name)

            def send_wheel(self, name):
                data = (index.folder / name).read_bytes()
                self.send_response(200)
                self.send_header("Content-Type", "application/octet-stream")
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                if index.holding and name.startswith(index.holding):
                    self.wfile.write(data[: len(data) // 2])
                    self.wfile.flush()
                    index.begun.set()
                    index.release.wait(60)
                    data = data[len(data) // 2 :]
                self.wfile.write(data)
                index.fetched.append(name)

            def answer(self, data, kind):
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_):
                pass

        return Handler
