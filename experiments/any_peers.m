% Frequency responses of models by Octave's control package, for any_peers.py.
%
%     octave-cli -qf any_peers.m METHOD LOWEST HIGHEST COUNT < LIST_OF_FILES
%
% METHOD is arx, n4sid or moen4. The model is of second order from the input to the differences of the output (the
% integrator is given, so that a bias is a mean), at 25 Hz, for several dead times, the one of least error in a simulation.
% Writes a line for each recording: file, seconds, real parts, imaginary parts at COUNT frequencies (rad/s).

1;

function [model, state] = identified (method, output, input, step_s)
  data = iddata (output, input, step_s);
  if (strcmp (method, "arx"))
    [model, state] = arx (data, "na", 2, "nb", 3);
  else
    [model, state] = feval (method, data, 2);
  endif
endfunction

function [best, best_delay] = over_delays (method, output, input, step_s)
  least = Inf;
  best = [];
  for delay = 0:4
    shifted = input(1:end - delay);
    measured = output(delay + 1:end);
    try
      [model, state] = identified (method, measured, shifted, step_s);
      times_s = (0:numel (shifted) - 1)' * step_s;
      distance = norm (lsim (model, shifted, times_s, state) - measured);
    catch
      continue
    end_try_catch
    if (distance < least)
      least = distance;
      [best, best_delay] = deal (model, delay);
    endif
  endfor
endfunction

pkg load control
warning ("off", "all");
[method, lowest, highest, count] = argv (){:};
omega = logspace (log10 (str2double (lowest)), log10 (str2double (highest)), str2double (count));
every = 4;
step_s = 0.01 * every;
while (ischar (file = fgetl (stdin)))
  text = fileread (file);
  head = sum (text(1:strfind (text, "time_s,")(1)) == "\n") + 1;
  columns = dlmread (file, ",", head, 0);
  count = floor (rows (columns) / every);
  input = mean (reshape (columns(1:count * every, 3), every, count), 1)';
  output = columns(1:every:count * every, 2);
  begin = cputime ();
  [model, delay] = over_delays (method, detrend (diff (output), 0), detrend (input(1:end - 1), 0), step_s);
  seconds = cputime () - begin;
  if (isempty (model))
    continue
  endif
  z = exp (1i * omega * step_s);
  response = squeeze (freqresp (model, omega)).' .* z .^ -delay ./ (z - 1);
  printf ("%s,%.3f", file, seconds);
  printf (",%.12g", real (response), imag (response));
  printf ("\n");
  fflush (stdout);
endwhile
