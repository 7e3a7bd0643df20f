"""Runs an ONNX model in onnxruntime and compares with the outputs written beside it.

    python3 -m venv .venv && .venv/bin/pip install onnxruntime==1.31.1 onnx==1.23.2 numpy
    onecycle pack export my.pack --onnx my.onnx --samples samples.safetensors
    .venv/bin/python experiments/onnx_check.py my.onnx samples.safetensors

The samples are a safetensors or npz file with `inputs` and `outputs`, a row each for a sample.
`cargo run --release -p onecycle-lab --example onnx` writes random networks, the paper's size
included, with samples. Status 1 where an output differs by more than 1e-5 of the largest one.
"""

import json
import struct
import sys

import numpy
import onnx
import onnxruntime

TOLERANCE = 1e-5


def samples(path):
    """Arrays by name."""
    if path.endswith(".npz"):
        return numpy.load(path)
    with open(path, "rb") as file:
        content = file.read()
    (length,) = struct.unpack("<Q", content[:8])
    header, data = json.loads(content[8 : 8 + length]), content[8 + length :]
    arrays = {}
    for name, entry in header.items():
        if name != "__metadata__":
            first, last = entry["data_offsets"]
            numbers = numpy.frombuffer(data[first:last], dtype="<f4")
            arrays[name] = numbers.reshape(entry["shape"])
    return arrays


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: onnx_check.py MODEL.onnx SAMPLES.safetensors")
    model, path = sys.argv[1:]
    onnx.checker.check_model(model, full_check=True)
    arrays = samples(path)
    inputs, expected = arrays["inputs"].astype(numpy.float32), arrays["outputs"]
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    (outputs,) = session.run(None, {session.get_inputs()[0].name: inputs})
    largest = float(numpy.abs(expected).max())
    difference = float(numpy.abs(outputs - expected).max())
    print(
        f"{model}: {len(inputs)} samples, {inputs.shape[1]} inputs, {outputs.shape[1]} outputs; "
        f"largest output {largest:.4g}, largest difference {difference:.3g} "
        f"({difference / largest:.2g} of it)"
    )
    # No number is not a small difference.
    if not difference <= TOLERANCE * largest:
        sys.exit("the outputs differ")


if __name__ == "__main__":
    main()
