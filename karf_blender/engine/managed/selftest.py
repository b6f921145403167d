"""Run by the environment's Python: whether the engine's packages load, and what torch finds. Imports nothing of KaRF.

Prints one line of JSON: versions, and the device. A package that does not load ends it with that error.
"""

import importlib
import json
import sys


def main() -> None:
    loaded = {name: importlib.import_module(name) for name in sys.argv[1:]}
    torch = loaded["torch"]
    if float(torch.ones(3).sum()) != 3.0:
        sys.exit("torch does not add up")
    if torch.version.cuda:
        build = "cuda"
    else:
        build = "rocm" if torch.version.hip else "cpu"
    has_mps = torch.backends.mps.is_available()
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "Apple GPU" if has_mps else "CPU"
    print(json.dumps({"torch": torch.__version__, "build": build, "device": device}), flush=True)


if __name__ == "__main__":
    main()
