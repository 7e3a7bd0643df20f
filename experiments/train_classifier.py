"""Trains the paper's classifier in PyTorch on sets of onecycle-lab, on CPU or GPU, and counts J as the sets do.

    onecycle-lab dataset research/program/reproduction/literal.toml --into sets
    python experiments/train_classifier.py sets
    python experiments/train_classifier.py sets --sizes --seeds 3      # a table of widths, depths and convolutions

Layers, dropout, epochs, batch, learning rate and loss are those of the recipe (Adam, steps of the rate). The first loss of the
recipe is learnt; --loss N takes another. Several folders give a row each. Each number of a row is the median over the seeds, with
the range. Tried with Python 3.11 and 3.12, PyTorch 2.9 to 2.15, NumPy 2.
"""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
import torch


def load(folder, name, device):
    with np.load(folder / f"{name}.npz") as columns:
        arrays = columns["inputs"], columns["labels"].astype(np.int64), columns["costs"]
    return [torch.from_numpy(array).to(device) for array in arrays]


# The paper tried models "of different depth and width up to four layers and 10000 neurons". Channels, width and stride of a
# convolution stand before the layers; None: the dropout of the recipe.
SIZES = [
    ([], [100], None),
    ([], [300, 100], None),
    ([], [1000, 400], None),
    ([], [3000, 1000], None),
    ([], [3000, 1000], 0.0),
    ([], [3000, 1000], 0.1),
    ([], [3000, 1000], 0.6),
    ([], [3000], None),
    ([], [3000, 1000, 300], None),
    ([], [3000, 1000, 300, 300], None),
    ([], [10000], None),
    ([], [10000, 1000], None),
    ([(16, 31, 4), (32, 15, 4), (32, 7, 4)], [300], None),
    ([(32, 31, 4), (64, 15, 4), (64, 7, 4)], [1000, 400], None),
]


def layers(inputs, convolutions, hidden, dropout, classes):
    if convolutions:
        yield torch.nn.Unflatten(1, (1, inputs))
        before = 1
        for channels, width, stride in convolutions:
            convolution = torch.nn.Conv1d(before, channels, width, stride)
            torch.nn.init.normal_(convolution.weight, std=(2.0 / (before * width)) ** 0.5)
            torch.nn.init.zeros_(convolution.bias)
            yield from (convolution, torch.nn.ReLU(), torch.nn.BatchNorm1d(channels))
            before = channels
            inputs = (inputs - width) // stride + 1
        yield torch.nn.Flatten()
        inputs *= before
    sizes = [inputs, *hidden]
    for before, after in zip(sizes, sizes[1:]):
        linear = torch.nn.Linear(before, after)
        # He, as onecycle-lab begins.
        torch.nn.init.normal_(linear.weight, std=(2.0 / before) ** 0.5)
        torch.nn.init.zeros_(linear.bias)
        yield from (linear, torch.nn.ReLU(), torch.nn.BatchNorm1d(after), torch.nn.Dropout(dropout))
    yield torch.nn.Linear(sizes[-1], classes)


def score(network, inputs, labels, costs):
    """Accuracy, mean of J with its sign, mean of max(J, 0), largest J, all of the stable loops; number of unstable ones."""
    network.eval()
    with torch.no_grad():
        picks = torch.cat([network(part).argmax(1) for part in inputs.split(2000)])
    j = costs.gather(1, picks[:, None])[:, 0]
    stable = j[torch.isfinite(j)]
    accuracy = (picks == labels).float().mean()
    return [float(x) for x in (accuracy, stable.mean(), stable.clamp(min=0).mean(), stable.max(), len(j) - len(stable))]


def trained(recipe, training, loss, network, seed):
    """The trained network, and the seconds that it took."""
    inputs, labels, costs = training
    torch.manual_seed(seed)
    convolutions, hidden, dropout = network
    network = torch.nn.Sequential(*layers(inputs.shape[1], convolutions, hidden, dropout, costs.shape[1])).to(inputs.device)
    gamma = torch.ones_like(costs)
    if loss != "cross_entropy":
        gamma += costs.clamp(0.0, loss["modified_softmax"]["cap"])
    schedule = recipe["schedule"]
    optimizer = torch.optim.Adam(network.parameters(), lr=schedule["rate"])
    step = schedule["shape"]["step"]
    begin = time.perf_counter()
    for epoch in range(recipe["epochs"]):
        for group in optimizer.param_groups:
            group["lr"] = schedule["rate"] * step["factor"] ** (epoch // step["every"])
        network.train()
        size = min(recipe["batch"], len(labels))
        for batch in torch.randperm(len(labels), device=inputs.device)[: len(labels) // size * size].split(size):
            optimizer.zero_grad()
            torch.nn.functional.cross_entropy(gamma[batch] * network(inputs[batch]), labels[batch]).backward()
            optimizer.step()
        if (epoch + 1) % 100 == 0:
            print(f"epoch {epoch + 1}, {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    # The device works ahead of the program: the score waits for it.
    score(network, *training)
    return network, time.perf_counter() - begin


def spread(values, form):
    """Median and range."""
    middle, low, high = statistics.median(values), min(values), max(values)
    return form(middle) if low == high else f"{form(middle)} ({form(low)} to {form(high)})"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    arguments.add_argument("--loss", type=int, default=0)
    arguments.add_argument("--seeds", type=int, default=1)
    sizes = arguments.add_mutually_exclusive_group()
    sizes.add_argument("--hidden", type=int, nargs="+")
    sizes.add_argument("--sizes", action="store_true", help="every network of SIZES")
    arguments = arguments.parse_args()
    device = "cuda" if torch.cuda.is_available() else "cpu"
    name = torch.cuda.get_device_name() if device == "cuda" else f"CPU, {torch.get_num_threads()} threads"
    print(f"Trained on: {name}, PyTorch {torch.__version__.split('+')[0]}\n")
    print("| network | parameters | classes | verification: right | mean of max(J, 0) | largest J "
          "| random: mean of max(J, 0) | largest J | unstable | training (s) |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    percent = lambda value: f"{100 * value:.2f} %"
    for folder in arguments.folders:
        recipe = json.loads((folder / "recipe.json").read_text())
        training, verification, *tests = [
            load(folder, path, device)
            for path in ["training", "verification", *sorted(path.stem for path in folder.glob("test*.npz"))]
        ]
        loss = recipe["losses"][arguments.loss]["loss"]
        networks = SIZES if arguments.sizes else [([], arguments.hidden or recipe["hidden"], None)]
        for convolutions, hidden, dropout in networks:
            dropout = recipe["dropout"] if dropout is None else dropout
            runs = []
            for seed in range(1, arguments.seeds + 1):
                network, took_s = trained(recipe, training, loss, (convolutions, hidden, dropout), seed)
                known, random = score(network, *verification), score(network, *tests[0])
                unstable = known[4] + random[4]
                runs.append([known[0], known[2], known[3], random[2], random[3], unstable, took_s])
            parameters = sum(weights.numel() for weights in network.parameters())
            before = "".join(f"{channels} channels of {width}, " for channels, width, _ in convolutions)
            forms = [percent] * 5 + [lambda value: f"{value:.0f}"] * 2
            cells = [spread(values, form) for values, form in zip(zip(*runs), forms)]
            print(f"| {before}{'-'.join(map(str, hidden))}, dropout {dropout:g} | {parameters:,} | {training[2].shape[1]} | "
                  + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
