"""What a study of 300 processes takes: `python py/benches/monte_carlo.py`, with the package built. Random processes of first order are
tested by a PRBS with 2 % of noise, identified with the structure given and left open, and asked whether the intervals hold."""

import time

import numpy as np

import onecycle

rng = np.random.default_rng(1)
times_s = rng.uniform(1, 10, 300)
truths = [{"k": k, "t_body_s": t, "tau_s": share * t} for k, t, share in zip(rng.uniform(0.5, 2, 300), times_s, rng.uniform(0.05, 0.5, 300))]
begin = time.perf_counter()
recordings = []
for seed, truth in enumerate(truths):
    process = onecycle.Model("foptd", **truth)
    sample_s = truth["t_body_s"] / 25
    u = np.repeat(rng.choice([-1.0, 1.0], 40), 20)
    y = onecycle.simulate(process, u, sample_s)
    recordings.append(onecycle.Recording(np.arange(u.size) * sample_s, u, y + 0.02 * y.std() * rng.standard_normal(u.size)))
print(f"simulated in {time.perf_counter() - begin:.1f} s")
for structure in ("foptd", None):
    begin = time.perf_counter()
    reports = onecycle.identify_many(recordings, 2, structure=structure, design=False)
    took_s = time.perf_counter() - begin
    held = {key: np.mean([found.model is not None and found.intervals[key].low <= truth[key] <= found.intervals[key].high
                          for found, truth in zip(reports, truths) if found.structure == "foptd"]) for key in ("k", "t_body_s", "tau_s")}
    right = sum(found.structure == "foptd" for found in reports)
    print(f"structure {structure or 'open'}: {right} of 300 of first order, {took_s:.1f} s with 2 threads; intervals hold for",
          ", ".join(f"{key} {100 * share:.0f} %" for key, share in held.items()))
