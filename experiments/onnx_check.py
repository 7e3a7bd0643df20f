"""Runs an ONNX model in onnxruntime and compares with the outputs written beside it.

    python3 -m venv .venv && .venv/bin/pip install onnxruntime==1.31.1 onnx==1.23.2 numpy
    onecycle-lab pack export my.pack --onnx my.onnx --samples samples.npz
    .venv/bin/python experiments/onnx_check.py my.onnx samples.npz

The samples are an npz file with `inputs` and `outputs`, one row for each sample. The status is 1 if
an output differs by more than 1e-5 of the largest one.
"""

import sys

import numpy
import onnx
import onnxruntime

TOLERANCE = 1e-5


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: onnx_check.py MODEL.onnx SAMPLES.npz")
    model, path = sys.argv[1:]
    onnx.checker.check_model(model, full_check=True)
    arrays = numpy.load(path)
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
