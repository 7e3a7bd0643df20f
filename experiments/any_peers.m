% Frequency responses of models by Octave's control package, for any_peers.py.
%
%     octave-cli -qf any_peers.m METHOD LOWEST HIGHEST COUNT < LIST_OF_FILES
%
% METHOD is arx, n4sid or moen4. Writes a line for each recording: file, seconds, real parts, imaginary parts at COUNT
% frequencies (rad/s). The model is of third order, for several dead times, the one of least error in a simulation.

1;

function [model, state] = identified (method, output, input, step_s)
  data = iddata (output, input, step_s);
  if (strcmp (method, "arx"))
    [model, state] = arx (data, "na", 3, "nb", 3);
  else
    [model, state] = feval (method, data, 3);
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
step_s = 0.01;
while (ischar (file = fgetl (stdin)))
  text = fileread (file);
  rows = textscan (text(strfind (text, "time_s")(1):end), "%f%f%f%*[^\n]", "Delimiter", ",", "HeaderLines", 1);
  begin = cputime ();
  [model, delay] = over_delays (method, detrend (rows{2}, 0), detrend (rows{3}, 0), step_s);
  seconds = cputime () - begin;
  if (isempty (model))
    continue
  endif
  response = squeeze (freqresp (model, omega)).' .* exp (-1i * omega * step_s * delay);
  printf ("%s,%.3f", file, seconds);
  printf (",%.12g", real (response), imag (response));
  printf ("\n");
  fflush (stdout);
endwhile
