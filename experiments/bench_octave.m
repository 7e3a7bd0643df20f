% Answers to the relay benchmark by Octave's control package, for comparison.
%
%     onecycle-lab bench make -o relay-benchmark --cases 50
%     octave -qf bench_octave.m relay-benchmark moen4 moen4.csv
%     onecycle-lab bench run relay-benchmark --methods onecycle-2 --answers moen4=moen4.csv
%
% Needs Debian's octave and octave-control (apt-get install octave octave-control). Nothing of truth.csv is
% read. Its identification as it is: arx (least squares) or moen4, n4sid, moesp (subspaces), of third order
% from input to output, 40 samples a cycle, for several dead times, the one of least error in a simulation;
% then the process with the frequency response nearest to it from the oscillation to its third harmonic.

1;

function model = identified (method, output, input, step_s)
  data = iddata (output, input, step_s);
  if (strcmp (method, "arx"))
    [model.sys, model.state] = arx (data, "na", 3, "nb", 3);
  else
    [model.sys, model.state] = feval (method, data, 3);
  endif
endfunction

% The best of several dead times, in samples; its response includes the dead time.
function best = over_delays (method, output, input, step_s)
  best.error = Inf;
  for delay = 0:8
    shifted = input(1:end - delay);
    measured = output(delay + 1:end);
    try
      model = identified (method, measured, shifted, step_s);
      times_s = (0:numel (shifted) - 1)' * step_s;
      found = lsim (model.sys, shifted, times_s, model.state);
    catch
      continue
    end_try_catch
    model.error = norm (found - measured) / sqrt (numel (measured));
    model.delay = delay;
    if (model.error < best.error)
      best = model;
    endif
  endfor
endfunction

% Sum of the squared differences of two frequency responses, the gain being the best one.
function [cost, gain] = difference (x, omega, wanted, weight)
  times_s = exp (x);
  s = 1i * omega;
  shape = exp (-times_s(3) * s) ./ (s .* (times_s(1) * s + 1) .* (times_s(2) * s + 1));
  ratio = shape ./ wanted;
  gain = sum (weight .^ 2 .* real (ratio)) / sum (weight .^ 2 .* abs (ratio) .^ 2);
  cost = sum (abs (weight .* (gain * ratio - 1)) .^ 2);
  if (any (times_s < [1e-3, 1e-2, 1e-4]) || any (times_s > [5, 50, 0.5]) || gain <= 0)
    cost += 1e3;
  endif
endfunction

function process = by_octave (method, u, y)
  sample_s = 1e-3;
  rises = find (diff (u) > 1) + 1;
  period = mean (diff (rises));
  every = max (floor (period / 40), 1);
  step_s = every * sample_s;
  % Whole cycles without their means: an integrator oscillates where its input is zero on average.
  count = floor ((rises(end) - rises(1)) / every);
  whole = rises(1):rises(1) + count * every - 1;
  input = mean (reshape (u(whole), every, count), 1)';
  output = y(whole)(1:every:end);
  model = over_delays (method, detrend (output, 0), detrend (input, 0), step_s);
  omega = 2 * pi / (period * sample_s) * logspace (log10 (0.8), log10 (3), 30);
  z = exp (1i * omega * step_s);
  % The model is of a held input: without the hold it is the process.
  hold = (1 - 1 ./ z) ./ (1i * omega * step_s);
  wanted = squeeze (freqresp (model.sys, omega)).' .* z .^ -model.delay ./ hold;
  weight = omega(1) ./ omega;
  best = Inf;
  for start = log ([0.05, 0.5, 0.005; 0.05, 1.5, 0.05; 0.15, 0.5, 0.05; 0.2, 1.2, 0.01; 0.1, 1.0, 0.03])'
    options = optimset ("MaxFunEvals", 4000, "MaxIter", 4000, "TolX", 1e-6, "TolFun", 1e-10);
    [x, cost] = fminsearch (@(x) difference (x, omega, wanted, weight), start', options);
    if (cost < best)
      best = cost;
      [~, gain] = difference (x, omega, wanted, weight);
      process = [gain, exp(x)];
    endif
  endfor
endfunction

pkg load control
% Its models of a noisy integrator are a little unstable now and then, and it says so each time.
warning ("off", "all");
[folder, method, out] = argv (){:};
files = sort (cellfun (@(name) fullfile (folder, "recordings", name), ...
                       {dir(fullfile (folder, "recordings", "*.csv")).name}, "UniformOutput", false));
table = fopen (out, "w");
fprintf (table, "experiment,K,T_prop_s,T_body_s,tau_s,seconds\n");
for k = 1:numel (files)
  columns = dlmread (files{k}, ",", 1, 0);
  [~, name] = fileparts (files{k});
  begin = cputime ();
  try
    process = by_octave (method, columns(:, 3), columns(:, 2));
  catch failure
    fprintf (stderr, "%s: %s\n", name, failure.message);
    continue
  end_try_catch
  fprintf (table, "%d,%.17g,%.17g,%.17g,%.17g,%.3f\n", str2double (name), process, cputime () - begin);
  fflush (table);
endfor
fclose (table);
