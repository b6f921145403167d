"""Tiny wheels in place of the engine's packages, and a local index that serves them."""

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
MODULES = {  # package -> module
    "numpy": "numpy",
    "scipy": "scipy",
    "safetensors": "safetensors",
    "filelock": "filelock",
    "imageio": "imageio",
    "pillow": "PIL",
    "pillow-heif": "pillow_heif",
    "opencv-python-headless": "cv2",
    "openexr": "OpenEXR",
    "numba": "numba",
}


def torch(version, cuda=None):
    """The code of a stand-in for torch."""
    return TORCH.format(version=version, cuda=cuda)


def make(folder, name, version, code=None, tag="py3-none-any", more=None):
    """Write the wheel of a package with this code and more files; returns its path."""
    stem = f"{name.replace('-', '_')}-{version}"
    info = f"{stem}.dist-info"
    files = {f"{MODULES.get(name, name)}/__init__.py": code or f"name = {name!r}\n", **(more or {})}
    files[f"{info}/METADATA"] = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: {tag}\n"
    rows = [f"{path},sha256={_hash(text)},{len(text.encode())}" for path, text in files.items()]
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    path = folder / f"{stem}-{tag}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for inside, text in files.items():
            entry = zipfile.ZipInfo(inside, (2026, 1, 1, 0, 0, 0))
            entry.external_attr = 0o100755 << 16  # executable
            archive.writestr(entry, text)
    return path


def locked(path, name, version):
    """The lock file's lines for a wheel."""
    data = path.read_bytes()
    return f"# {path.name} {len(data)}\n{name}=={version} \\\n    --hash=sha256:{hashlib.sha256(data).hexdigest()}\n"


def _hash(text):
    return base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()


class Index(ThreadingHTTPServer):
    """A package index of a folder's wheels. `fetched` has the names of whole files; `holding` stops one halfway."""

    daemon_threads = True

    def __init__(self, folder):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.folder, self.fetched, self.begun = folder, [], threading.Event()
        self.holding, self.release = "", threading.Event()
        self.url = f"http://127.0.0.1:{self.server_port}/simple"
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def packages(self):
        """Names of the fetched packages."""
        return {name.partition("-")[0] for name in self.fetched}

    def close(self):
        self.release.set()
        self.shutdown()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self):
        index, (kind, name) = self.server, self.path.strip("/").split("/")
        if kind == "simple":
            found = [path.name for path in index.folder.glob(f"{name.replace('-', '_')}-*.whl")]
            links = [f'<a data-core-metadata="true" href="/files/{file}">{file}</a>' for file in found]
            data = f"<!DOCTYPE html><html><body>{''.join(links)}</body></html>".encode()
        elif name.endswith(".metadata"):
            info = "-".join(name.split("-")[:2]) + ".dist-info/METADATA"
            data = zipfile.ZipFile(index.folder / name.removesuffix(".metadata")).read(info)
        else:
            data = (index.folder / name).read_bytes()
        self.send_response(200)
        self.send_header("Content-Type", "text/html" if kind == "simple" else "application/octet-stream")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if index.holding and name.startswith(index.holding) and name.endswith(".whl"):
            self.wfile.write(data[: len(data) // 2])
            self.wfile.flush()
            index.begun.set()
            index.release.wait(60)
            data = data[len(data) // 2 :]
        self.wfile.write(data)
        if name.endswith(".whl"):
            index.fetched.append(name)

    def log_message(self, *_):
        """Say nothing."""
