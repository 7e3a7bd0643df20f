"""Trains the paper's classifier in PyTorch on sets of onecycle-lab, on CPU or GPU, and counts J as the sets do.

    onecycle-lab dataset research/program/reproduction/literal.toml --into sets
    python experiments/train_classifier.py sets

Layers, dropout, epochs, batch, learning rate and loss are those of the recipe (Adam, steps of the rate). The first loss of the
recipe is learnt; --loss N takes another. Tried with Python 3.11, PyTorch 2.15, NumPy 2.4.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch


def load(folder, name, device):
    with np.load(folder / f"{name}.npz") as columns:
        arrays = columns["inputs"], columns["labels"].astype(np.int64), columns["costs"]
    return [torch.from_numpy(array).to(device) for array in arrays]


def layers(inputs, hidden, dropout, classes):
    sizes = [inputs, *hidden]
    for before, after in zip(sizes, sizes[1:]):
        linear = torch.nn.Linear(before, after)
        # He, as onecycle-lab begins.
        torch.nn.init.normal_(linear.weight, std=(2.0 / before) ** 0.5)
        torch.nn.init.zeros_(linear.bias)
        yield from (linear, torch.nn.ReLU(), torch.nn.BatchNorm1d(after), torch.nn.Dropout(dropout))
    yield torch.nn.Linear(sizes[-1], classes)


def score(network, inputs, labels, costs):
    """Accuracy; mean of J with its sign, mean of max(J, 0), largest J of the stable loops; number of unstable ones."""
    network.eval()
    with torch.no_grad():
        picks = network(inputs).argmax(1)
    j = costs.gather(1, picks[:, None])[:, 0]
    stable = j[torch.isfinite(j)]
    accuracy = (picks == labels).float().mean()
    numbers = [accuracy, stable.mean(), stable.clamp(min=0).mean(), stable.max()]
    text = ", ".join(f"{100 * float(number):.2f} %" for number in numbers)
    return f"{text}, {len(j) - len(stable)} unstable"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--loss", type=int, default=0)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--hidden", type=int, nargs="+")
    arguments = arguments.parse_args()
    recipe = json.loads((arguments.folder / "recipe.json").read_text())
    device = "cuda" if torch.cuda.is_available() else "cpu"
    torch.manual_seed(arguments.seed)
    inputs, labels, costs = load(arguments.folder, "training", device)
    hidden = arguments.hidden or recipe["hidden"]
    network = torch.nn.Sequential(*layers(inputs.shape[1], hidden, recipe["dropout"], costs.shape[1])).to(device)
    loss = recipe["losses"][arguments.loss]["loss"]
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
        for batch in torch.randperm(len(labels), device=device)[: len(labels) // size * size].split(size):
            optimizer.zero_grad()
            torch.nn.functional.cross_entropy(gamma[batch] * network(inputs[batch]), labels[batch]).backward()
            optimizer.step()
        if (epoch + 1) % 50 == 0:
            print(f"epoch {epoch + 1}, {time.perf_counter() - begin:.0f} s on {device}", flush=True)
    print("accuracy, mean J, mean of max(J, 0), largest J, unstable")
    for path in sorted(arguments.folder.glob("*.npz")):
        print(f"{path.stem:12} {score(network, *load(arguments.folder, path.stem, device))}")


if __name__ == "__main__":
    main()
