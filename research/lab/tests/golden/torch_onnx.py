"""Models exported by PyTorch, and the numbers it gives for them.

Both exporters write the same network: inputs normalised, a dense layer without biases, batch
normalisation that has been evaluated, dropout, tanh and ReLU.

    python3 -m venv .venv && .venv/bin/pip install torch==2.15.0 onnx==1.23.2 onnxscript==0.7.2
    .venv/bin/python research/lab/tests/golden/torch_onnx.py

writes torch_onnx.onnx, torch_onnx_script.onnx (the older exporter) and torch_onnx.json.
"""

import json
import pathlib

import onnx
import torch

INPUTS, OUTPUTS, BATCH = 5, 3, 8


class Model(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.register_buffer("offsets", torch.randn(INPUTS))
        self.register_buffer("scales", torch.rand(INPUTS) + 0.5)
        self.layers = torch.nn.Sequential(
            torch.nn.Linear(INPUTS, 7),
            torch.nn.Tanh(),
            torch.nn.Linear(7, 6, bias=False),
            torch.nn.BatchNorm1d(6),
            torch.nn.ReLU(),
            torch.nn.BatchNorm1d(6),
            torch.nn.Dropout(0.2),
            torch.nn.Linear(6, OUTPUTS),
        )

    def forward(self, inputs):
        return self.layers((inputs - self.offsets) * self.scales)


def main():
    here = pathlib.Path(__file__).parent
    torch.manual_seed(4)
    model = Model()
    for norm in [model.layers[3], model.layers[5]]:
        torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
        torch.nn.init.normal_(norm.bias)
        norm.running_mean.normal_()
        norm.running_var.uniform_(0.5, 2.0)
    model.eval()
    inputs = torch.randn(BATCH, INPUTS)
    names = dict(input_names=["x"], output_names=["y"])
    torch.onnx.export(
        model,
        (inputs,),
        here / "torch_onnx.onnx",
        dynamo=True,
        external_data=False,
        dynamic_shapes=({0: torch.export.Dim("batch")},),
        **names,
    )
    torch.onnx.export(
        model,
        (inputs,),
        here / "torch_onnx_script.onnx",
        dynamo=False,
        opset_version=17,
        dynamic_axes={"x": {0: "batch"}},
        **names,
    )
    # The stack of the exporting machine, which is nobody's business.
    exported = onnx.load(here / "torch_onnx.onnx")
    for part in [*exported.graph.node, *exported.graph.value_info, exported.graph]:
        del part.metadata_props[:]
    onnx.save(exported, here / "torch_onnx.onnx")
    # In float64: what differs from it is the rounding of the program under test.
    outputs = model.double()(inputs.double())
    golden = {
        "torch": torch.__version__,
        "inputs": inputs.flatten().tolist(),
        "outputs": outputs.flatten().tolist(),
    }
    (here / "torch_onnx.json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
