"""Trains the identifier's network on a dataset, in PyTorch, and writes it as ONNX.

    onecycle-lab dataset --examples 45000 --into multirotors
    python examples/train_pytorch.py multirotors network.onnx
    onecycle-lab pack import network.onnx --like default -o network.pack

The dataset is a folder of npz files and a manifest.json; its last tenth validates. The network,
34-H-H-14 with tanh, puts out a Gaussian of four scaled values: their mean, the logarithms of the
diagonal of L, then the elements below it row by row, with precision = L L^T.

Tried with Python 3.11, PyTorch 2.15, NumPy 2.4, onnx 1.23, onnxscript 0.7.
"""

import argparse
import json
import math
from pathlib import Path

import numpy as np
import torch

# Values of the order of one, as onecycle_lab::learn::dataset::learning has them.
SCALE = np.array([1.0, 8.0, 8.0, 1.0])
VALUES = 4
OUTPUTS = 2 * VALUES + VALUES * (VALUES - 1) // 2


def load(folder):
    """Inputs and scaled values of all examples, in the order of their numbers."""
    manifest = json.loads((folder / "manifest.json").read_text())
    if manifest["format"] != "onecycle.dataset/1" or None in manifest["shards"]:
        raise SystemExit(f"{folder} holds no finished dataset of this format")
    inputs, values = [], []
    for shard in range(len(manifest["shards"])):
        with np.load(folder / f"shard-{shard:05}.npz") as columns:
            inputs.append(columns["inputs"])
            values.append(columns["values"])
    inputs, values = np.concatenate(inputs), np.concatenate(values)
    # ln(samples in a period) is 3.7 to 7.8.
    inputs[:, -1] = (inputs[:, -1] - 6.0) / 2.0
    return torch.from_numpy(inputs), torch.from_numpy((SCALE * values).astype(np.float32))


def negative_log_likelihood(outputs, values):
    """-ln N(values), mean over the batch."""
    off = values - outputs[:, :VALUES]
    logs = outputs[:, VALUES : 2 * VALUES]
    factor = torch.diag_embed(logs.exp())
    rows, columns = torch.tril_indices(VALUES, VALUES, offset=-1)
    factor[:, rows, columns] = outputs[:, 2 * VALUES :]
    # w = L^T (y - mu)
    w = torch.einsum("nij,ni->nj", factor, off)
    constant = 0.5 * VALUES * math.log(2.0 * math.pi)
    return (constant - logs.sum(1) + 0.5 * (w * w).sum(1)).mean()


def network(hidden):
    return torch.nn.Sequential(
        torch.nn.Linear(34, hidden),
        torch.nn.Tanh(),
        torch.nn.Linear(hidden, hidden),
        torch.nn.Tanh(),
        torch.nn.Linear(hidden, OUTPUTS),
    )


def rate(step, steps, warm_up):
    """Of the highest learning rate: rises over the warm-up, then falls as a cosine to 1 %."""
    if step < warm_up:
        return (step + 1) / warm_up
    return 0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * step / steps))


def train(model, training, validation, arguments):
    inputs, values = training
    count, size = len(inputs), min(arguments.batch, len(inputs))
    optimizer = torch.optim.Adam(model.parameters(), lr=arguments.rate)
    steps = arguments.epochs * (count // size)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda step: rate(step, steps, max(1, count // size // 2))
    )
    best, best_loss = None, math.inf
    for epoch in range(1, arguments.epochs + 1):
        order = torch.randperm(count)
        for batch in order[: count // size * size].split(size):
            optimizer.zero_grad()
            negative_log_likelihood(model(inputs[batch]), values[batch]).backward()
            optimizer.step()
            schedule.step()
        with torch.no_grad():
            loss = negative_log_likelihood(model(validation[0]), validation[1]).item()
        if loss < best_loss:
            best, best_loss = {name: t.clone() for name, t in model.state_dict().items()}, loss
        print(f"epoch {epoch}: validation loss {loss:.4f}")
    if best is None:
        raise SystemExit("the validation loss was never finite: a lower --rate may help")
    print(f"best validation loss {best_loss:.4f}")
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the dataset")
    parser.add_argument("out", type=Path, help="the .onnx file to write")
    parser.add_argument("--hidden", type=int, default=48)
    parser.add_argument("--epochs", type=int, default=60)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--rate", type=float, default=4e-3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()

    torch.manual_seed(arguments.seed)
    inputs, values = load(arguments.folder)
    split = len(inputs) - len(inputs) // 10
    model = network(arguments.hidden)
    training, validation = (inputs[:split], values[:split]), (inputs[split:], values[split:])
    best = train(model, training, validation, arguments)
    model.load_state_dict(best)
    torch.onnx.export(
        model.eval(),
        (inputs[:2],),
        arguments.out,
        dynamo=True,
        external_data=False,
        dynamic_shapes=({0: torch.export.Dim("batch")},),
    )


if __name__ == "__main__":
    main()
