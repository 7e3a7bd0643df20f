"""Trains the identifier's network on a dataset, in JAX, and writes it as ONNX.

    onecycle-lab dataset --examples 45000 --into multirotors
    python examples/train_jax.py multirotors network.onnx
    onecycle-lab pack import network.onnx --like default -o network.pack

The dataset is a folder of npz files and a manifest.json; its last tenth validates. The network,
34-H-H-14 with tanh, puts out a Gaussian of four scaled values: their mean, the logarithms of the
diagonal of L, then the elements below it row by row, with precision = L L^T.

Tried with Python 3.11, JAX 0.10.2, NumPy 2.4, onnx 1.23.
"""

import argparse
import json
import math
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

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
    return inputs, (SCALE * values).astype(np.float32)


def initial(key, hidden):
    """Weights out x in and biases, uniform up to 1 / sqrt(in), by their names."""
    parameters = {}
    for stage, (wide, high) in zip((0, 2, 4), ((34, hidden), (hidden, hidden), (hidden, OUTPUTS))):
        key, *keys = jax.random.split(key, 3)
        bound = 1.0 / math.sqrt(wide)
        for name, shape, own in (("weight", (high, wide), keys[0]), ("bias", (high,), keys[1])):
            drawn = jax.random.uniform(own, shape, minval=-bound, maxval=bound)
            parameters[f"{stage}.{name}"] = drawn
    return parameters


def forward(parameters, inputs):
    for stage in (0, 2, 4):
        inputs = inputs @ parameters[f"{stage}.weight"].T + parameters[f"{stage}.bias"]
        if stage < 4:
            inputs = jnp.tanh(inputs)
    return inputs


def negative_log_likelihood(parameters, inputs, values):
    """-ln N(values), mean over the batch."""
    outputs = forward(parameters, inputs)
    off = values - outputs[:, :VALUES]
    logs = outputs[:, VALUES : 2 * VALUES]
    rows, columns = np.tril_indices(VALUES, -1)
    factor = jnp.zeros((len(inputs), VALUES, VALUES))
    factor = factor.at[:, rows, columns].set(outputs[:, 2 * VALUES :])
    factor += jnp.exp(logs)[:, :, None] * jnp.eye(VALUES)
    # w = L^T (y - mu)
    w = jnp.einsum("nij,ni->nj", factor, off)
    constant = 0.5 * VALUES * math.log(2.0 * math.pi)
    return (constant - logs.sum(1) + 0.5 * (w * w).sum(1)).mean()


validation_loss = jax.jit(negative_log_likelihood)


@partial(jax.jit, donate_argnums=0)
def step(state, inputs, values, rate):
    """One step of Adam; the state is parameters, first and second moments, steps so far."""
    parameters, first, second, count = state
    gradient = jax.grad(negative_log_likelihood)(parameters, inputs, values)
    count += 1
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, first, gradient)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, second, gradient)
    moved = lambda p, m, v: p - rate * (m / (1 - 0.9**count)) / (
        jnp.sqrt(v / (1 - 0.999**count)) + 1e-8
    )
    return jax.tree.map(moved, parameters, first, second), first, second, count


def rate(step, steps, warm_up):
    """Of the highest learning rate: rises over the warm-up, then falls as a cosine to 1 %."""
    if step < warm_up:
        return (step + 1) / warm_up
    return 0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * step / steps))


def train(parameters, training, validation, arguments):
    inputs, values = training
    count, size = len(inputs), min(arguments.batch, len(inputs))
    steps_per_epoch = count // size
    steps, warm_up = arguments.epochs * steps_per_epoch, max(1, steps_per_epoch // 2)
    shuffle = np.random.default_rng(arguments.seed)
    zeros = lambda: jax.tree.map(jnp.zeros_like, parameters)
    state = (parameters, zeros(), zeros(), 0)
    best, best_loss, done = None, math.inf, 0
    for epoch in range(1, arguments.epochs + 1):
        order = shuffle.permutation(count)[: steps_per_epoch * size]
        for batch in order.reshape(-1, size):
            now = arguments.rate * rate(done, steps, warm_up)
            state = step(state, inputs[batch], values[batch], now)
            done += 1
        loss = float(validation_loss(state[0], *validation))
        if loss < best_loss:
            best, best_loss = jax.tree.map(np.array, state[0]), loss
        print(f"epoch {epoch}: validation loss {loss:.4f}")
    if best is None:
        raise SystemExit("the validation loss was never finite: a lower --rate may help")
    print(f"best validation loss {best_loss:.4f}")
    return best


def model(parameters):
    """The network as ONNX: dense layers with tanh between them."""
    nodes, current = [], "inputs"
    for stage in (0, 2, 4):
        constants = [f"{stage}.weight", f"{stage}.bias"]
        output = f"sum_{stage}" if stage < 4 else "outputs"
        nodes.append(helper.make_node("Gemm", [current, *constants], [output], transB=1))
        if stage < 4:
            current = f"tanh_{stage}"
            nodes.append(helper.make_node("Tanh", [output], [current]))
    rows = lambda name, columns: helper.make_tensor_value_info(
        name, TensorProto.FLOAT, ["batch", columns]
    )
    numbers = [numpy_helper.from_array(values, name) for name, values in parameters.items()]
    graph = helper.make_graph(
        nodes, "network", [rows("inputs", 34)], [rows("outputs", OUTPUTS)], numbers
    )
    return helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    )


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

    inputs, values = load(arguments.folder)
    split = len(inputs) - len(inputs) // 10
    parameters = initial(jax.random.key(arguments.seed), arguments.hidden)
    training, validation = (inputs[:split], values[:split]), (inputs[split:], values[split:])
    best = train(parameters, training, validation, arguments)
    onnx.save(model(best), arguments.out)


if __name__ == "__main__":
    main()
