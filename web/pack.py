"""Puts the WebAssembly and the example into the page: pack.py WASM PAGE EXAMPLE OUT."""

import base64
import gzip
import sys

wasm, page, example, out = sys.argv[1:]


def packed(path: str) -> str:
    with open(path, "rb") as file:
        return base64.b64encode(gzip.compress(file.read(), 9, mtime=0)).decode()


with open(page, encoding="utf-8") as file:
    text = file.read()
for name, path in {"@WASM@": wasm, "@EXAMPLE@": example}.items():
    if text.count(name) != 1:
        sys.exit(f"pack.py: {page} must hold {name} once")
    text = text.replace(name, packed(path))
with open(out, "w", encoding="utf-8") as file:
    file.write(text)
print(f"{out}: {len(text.encode()) / 1e6:.2f} MB")
