"""Numbers of PyTorch for the trainer's tests: forward, losses, gradients, optimiser steps.

Everything is computed in float64 from inputs and weights that are exact in float32, so that what
differs from these numbers is the rounding of the program under test.

    python3 -m venv .venv && .venv/bin/pip install torch==2.15.0
    .venv/bin/python research/lab/tests/golden/torch_steps.py

writes torch_steps.json.
"""

import json
import pathlib

import torch

INPUTS, HIDDEN, CLASSES, BATCH = 5, 8, 4, 6
DIMENSION = 3


def exact(*shape):
    """Random numbers with few bits."""
    return torch.round(torch.randn(*shape) * 1024) / 1024


def network():
    """The same weights each time."""
    torch.manual_seed(2)
    net = torch.nn.Sequential(
        torch.nn.Linear(INPUTS, HIDDEN),
        torch.nn.BatchNorm1d(HIDDEN),
        torch.nn.ReLU(),
        torch.nn.Dropout(0.0),
        torch.nn.Linear(HIDDEN, CLASSES),
    )
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.copy_(exact(*parameter.shape))
        net[1].running_mean.copy_(exact(HIDDEN))
        net[1].running_var.copy_(exact(HIDDEN).square() + 0.5)
    return net


def tensors(net):
    """Floating-point tensors by name."""
    state = net.state_dict().items()
    return {name: numbers(value) for name, value in state if value.is_floating_point()}


def numbers(tensor):
    return tensor.detach().double().flatten().tolist()


def steps(make_optimizer, inputs, classes):
    """Weights after three steps on the same batch."""
    net = network().double()
    optimizer = make_optimizer(net.parameters())
    for _ in range(3):
        optimizer.zero_grad()
        torch.nn.functional.cross_entropy(net(inputs), classes).backward()
        optimizer.step()
    return tensors(net)


def gaussian(outputs):
    """The density that lab's `train::density` describes."""
    d = DIMENSION
    factor = torch.diag_embed(outputs[..., d : 2 * d].exp())
    rows, columns = torch.tril_indices(d, d, -1)
    factor[..., rows, columns] = outputs[..., 2 * d :]
    precision = factor @ factor.mT
    return torch.distributions.MultivariateNormal(outputs[..., :d], precision_matrix=precision)


def density(outputs, values):
    """Negative log likelihood, its gradient."""
    outputs = outputs.double().requires_grad_()
    loss = -gaussian(outputs).log_prob(values.double()).mean()
    loss.backward()
    return {
        "outputs": numbers(outputs),
        "values": numbers(values),
        "loss": loss.item(),
        "gradient": numbers(outputs.grad),
    }


def main():
    here = pathlib.Path(__file__).parent
    net = network()
    torch.manual_seed(3)
    inputs, classes = exact(BATCH, INPUTS), torch.randint(CLASSES, (BATCH,))

    before = tensors(net)
    net = net.double()
    inputs = inputs.double()
    evaluated = numbers(net.eval()(inputs))
    net.train()
    outputs = net(inputs)
    outputs.retain_grad()
    loss = torch.nn.functional.cross_entropy(outputs, classes)
    loss.backward()

    size = DIMENSION * (DIMENSION + 3) // 2
    sgd = lambda p: torch.optim.SGD(p, lr=0.1, momentum=0.9, weight_decay=0.01)
    adam = lambda p: torch.optim.AdamW(p, lr=0.01, weight_decay=0.1)
    golden = {
        "torch": torch.__version__,
        "inputs": numbers(inputs),
        "classes": classes.tolist(),
        "before": before,
        "evaluated": evaluated,
        "outputs": numbers(outputs),
        "loss": loss.item(),
        "output_gradient": numbers(outputs.grad),
        "gradients": {name: numbers(p.grad) for name, p in net.named_parameters()},
        "after_forward": tensors(net),
        "after_sgd": steps(sgd, inputs, classes),
        "after_adam": steps(adam, inputs, classes),
        "gaussian": density(exact(BATCH, size), exact(BATCH, DIMENSION)),
    }
    (here / "torch_steps.json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
