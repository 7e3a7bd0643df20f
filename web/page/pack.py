"""Makes the page one file: pack.py WASM EXAMPLES OUT. Python 3 without packages."""

import base64
import gzip
import pathlib
import re
import sys

wasm, examples, out = map(pathlib.Path, sys.argv[1:])
here = pathlib.Path(__file__).parent


def packed(path):
    return base64.b64encode(gzip.compress(path.read_bytes(), 9, mtime=0)).decode()


def part(found):
    files = {"WASM": wasm, "HOVER": examples / "simulated_hover.csv", "CHIRPS": examples / "logs/px4_chirps.ulg"}
    name = found[1]
    return packed(files[name]) if name in files else (here / name).read_text(encoding="utf-8")


page = (here / "page.html").read_text(encoding="utf-8")
page = re.sub(r"@(WASM|HOVER|CHIRPS|[a-z]+\.(?:css|js))@", part, page)
out.write_text(page, encoding="utf-8")
print(f"{out}: {out.stat().st_size / 1e6:.2f} MB")
