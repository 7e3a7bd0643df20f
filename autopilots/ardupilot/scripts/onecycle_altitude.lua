-- Relay test of the altitude in Guided, written to a CSV file for `onecycle identify`. For unmodified ArduCopter.
--
-- Hover in Guided, at least OCA_H_MAX + 3 m high. The switch is an auxiliary function (RCn_OPTION), 300 unless OCA_FUNC says
-- otherwise: high starts the test, low ends it. For two seconds the mean throttle is measured; then a relay moves the throttle
-- by OCA_AMP about it, and rates of turn keep the vehicle level and bring it to a halt. At the end Guided flies back to the
-- place and the height of the start. If the script fails, Guided holds the height after 0.2 s (GUID_TIMEOUT during the test).
--
-- The relay switches at 0.73 of the last peak, before zero (e: height of the start less a filtered height). OCA_LAG is the time
-- constant of that filter: a longer one makes the oscillation slower and larger. It is not part of what is recorded.
-- Columns: time (s), input: throttle, output: height (m). The height is the integral of the estimated climb rate, because the barometer pulls
-- the estimated height about.

local GUIDED, LOITER = 4, 5
local LOW, HIGH = 0, 2
local WARNING, NOTICE = 4, 5
local PERIOD_MS = 5
local BETA = -0.73
local SETTLE_S = 2.0
local KICK_M = 0.01           -- the relay starts when the height has moved by this
local LEAST_PEAK_M = 0.002
local NO_SWITCH_S = 2.0
local LEAST_TICK_S = 0.002
local LATE_S = 0.1            -- a tick that is later ends the test
local STICK_MAX = 0.1
local TILT_MAX_RAD = math.rad(20)
local SPEED_MAX_MS = 3.0
local ATTITUDE_GAIN = 4.0     -- 1/s, of the angles to the rates
local BRAKE_RAD_S_M = 0.08    -- lean against the horizontal speed
local TEST_TIMEOUT_S = 0.2

assert(param:add_table(87, "OCA_", 5), "onecycle: no parameter table")
local function own(number, name, value)
   assert(param:add_param(87, number, name, value), "onecycle: no parameter")
   return Parameter("OCA_" .. name)
end
local switch_function = own(1, "FUNC", 300)
local amplitude = own(2, "AMP", 0.1)
local lag = own(3, "LAG", 0.1)
local duration = own(4, "TIME", 10)
local height_max = own(5, "H_MAX", 1.5)

local test = nil              -- the test that runs
local last_position = nil

local function say(severity, ...)
   gcs:send_text(severity, "onecycle: altitude " .. string.format(...))
end

local function now_s()
   return micros():tofloat() * 1e-6
end

-- Height above the origin, climb rate (m, m/s), and the horizontal speed forward and to the right; nil without an estimate.
local function motion()
   local position, velocity = ahrs:get_relative_position_NED_origin(), ahrs:get_velocity_NED()
   if position == nil or velocity == nil then
      return nil
   end
   local yaw = ahrs:get_yaw_rad()
   local forward = velocity:x() * math.cos(yaw) + velocity:y() * math.sin(yaw)
   local right = velocity:y() * math.cos(yaw) - velocity:x() * math.sin(yaw)
   return -position:z(), -velocity:z(), forward, right
end

local function sticks()
   local values = {}
   for i, name in ipairs({ "RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_THROTTLE", "RCMAP_YAW" }) do
      values[i] = rc:get_channel(param:get(name)):norm_input()
   end
   return values
end

local function not_ready()
   local up = -(ahrs:get_relative_position_D_home() or 0)
   if not arming:is_armed() or not vehicle:get_likely_flying() then
      return "not flying"
   elseif vehicle:get_mode() ~= GUIDED then
      return "not in Guided"
   elseif motion() == nil then
      return "no estimate of height"
   elseif up < height_max:get() + 3 then
      return string.format("climb to %.0f m first", math.ceil(height_max:get() + 3))
   elseif not (amplitude:get() > 0 and amplitude:get() <= 0.3 and lag:get() >= 0) then
      return "OCA_AMP or OCA_LAG out of range"
   end
   return nil
end

local function begin()
   local problem = not_ready()
   if problem ~= nil then
      say(WARNING, "refused: %s", problem)
      return
   end
   local height, climb = motion()
   test = {
      began_s = now_s(), last_s = now_s(), height = height, climb = climb, sticks = sticks(), place = ahrs:get_location(),
      yaw = ahrs:get_yaw_rad(), sum = 0, count = 0, y = 0, filtered = 0, rows = {},
   }
   say(NOTICE, "test begins")
end

-- The relay begins: about the mean throttle, as soon as the height has moved by KICK_M.
local function begin_relay()
   test.offset = test.sum / test.count
   test.timeout = param:get("GUID_TIMEOUT")
   param:set("GUID_TIMEOUT", TEST_TIMEOUT_S)
   test.y, test.filtered, test.relay_s = 0, 0, now_s()
   test.sign, test.peak, test.half_s, test.switches = 1, nil, 0, 0
   test.switched_s, test.cycle_s, test.cycle_sum = test.relay_s, test.relay_s, 0
end

-- One tick of the relay; returns the throttle.
local function relay(now, dt)
   local h = amplitude:get()
   test.filtered = test.filtered + dt / (dt + lag:get()) * (test.y_now - test.filtered)
   test.cycle_sum = test.cycle_sum + test.sign * dt
   if test.peak == nil then
      if math.abs(test.filtered) < KICK_M then
         return test.offset + h * test.sign
      end
      test.sign = test.filtered > 0 and -1 or 1
      test.peak = 0
      test.switched_s = now
   end
   local e = -test.sign * test.filtered
   test.peak = math.max(test.peak, e)
   if e > -BETA * test.peak or test.peak < LEAST_PEAK_M or now - test.switched_s < 0.3 * test.half_s then
      return test.offset + h * test.sign
   end
   test.sign, test.peak = -test.sign, math.max(0, -e)
   test.half_s, test.switched_s, test.switches = now - test.switched_s, now, test.switches + 1
   if test.sign > 0 then
      if test.switches > 3 then
         -- In a steady cycle the mean of the throttle holds the vehicle.
         local mean = h * test.cycle_sum / (now - test.cycle_s)
         test.offset = test.offset + 0.5 * math.max(-0.5 * h, math.min(0.5 * h, mean))
      end
      test.cycle_s, test.cycle_sum = now, 0
   end
   return test.offset + h * test.sign
end

-- Why the test must end now, or nil.
local function reason_to_stop(now, dt, height, forward, right)
   if not arming:is_armed() then
      return "disarmed"
   elseif vehicle:get_mode() ~= GUIDED then
      return "mode changed"
   elseif height == nil then
      return "no estimate"
   elseif math.abs(height - test.height) > height_max:get() then
      return "height out of OCA_H_MAX"
   elseif math.max(math.abs(forward), math.abs(right)) > SPEED_MAX_MS then
      return "too fast sideways"
   elseif math.max(math.abs(ahrs:get_roll_rad()), math.abs(ahrs:get_pitch_rad())) > TILT_MAX_RAD then
      return "tilted"
   elseif dt > LATE_S then
      return string.format("script late by %.0f ms", 1000 * dt)
   elseif test.offset ~= nil and now - test.switched_s > NO_SWITCH_S then
      return "OCA_AMP too small"
   end
   for i, value in ipairs(sticks()) do
      if math.abs(value - test.sticks[i]) > STICK_MAX then
         return "stick moved"
      end
   end
   return nil
end

-- The name of the file written, or nil.
local function write()
   for number = 1, 99 do
      local name = string.format("onecycle_altitude_%02d.csv", number)
      local there = io.open(name, "r")
      if there == nil then
         local file = io.open(name, "w")
         if file == nil then
            return nil
         end
         file:write("time_s,input,output\n")
         for _, row in ipairs(test.rows) do
            file:write(row)
         end
         file:close()
         return name
      end
      there:close()
   end
   return nil
end

-- Ends the test: Guided flies to the place of the start; a moved stick gets Loiter.
local function finish(reason)
   if test.timeout ~= nil then
      param:set("GUID_TIMEOUT", test.timeout)
   end
   if reason == "stick moved" then
      vehicle:set_mode(LOITER)
   elseif vehicle:get_mode() == GUIDED then
      vehicle:set_target_location(test.place)
   end
   local name = #test.rows > 0 and write() or "no file"
   if reason ~= nil then
      say(WARNING, "stopped: %s", reason)
   else
      say(NOTICE, "done: %s", name)
   end
   test = nil
end

-- Rates that keep the vehicle level and bring it to a halt (deg/s).
local function rates(forward, right)
   local function lean(speed)
      return math.max(-0.15, math.min(0.15, BRAKE_RAD_S_M * speed))
   end
   local yaw = test.yaw - ahrs:get_yaw_rad()
   yaw = math.atan(math.sin(yaw), math.cos(yaw))
   return math.deg(ATTITUDE_GAIN * (-lean(right) - ahrs:get_roll_rad())),
      math.deg(ATTITUDE_GAIN * (lean(forward) - ahrs:get_pitch_rad())), math.deg(yaw)
end

local function tick()
   local now = now_s()
   local dt = now - test.last_s
   if dt < LEAST_TICK_S then
      return
   end
   local height, climb, forward, right = motion()
   local reason = reason_to_stop(now, dt, height, forward, right)
   if reason ~= nil then
      finish(reason)
      return
   end
   if test.offset == nil then
      test.last_s, test.climb = now, climb
      test.sum, test.count = test.sum + motors:get_throttle(), test.count + 1
      if now - test.began_s > SETTLE_S then
         begin_relay()
      end
      return
   end
   test.y_now = test.y + 0.5 * (climb + test.climb) * dt
   local throttle = relay(now, dt)
   local roll, pitch, yaw = rates(forward, right)
   if not vehicle:set_target_rate_and_throttle(roll, pitch, yaw, throttle) then
      finish("throttle refused")
      return
   end
   -- Other threads may have run meanwhile: what is recorded is of the moment in which the throttle is in force.
   local after = now_s()
   _, climb = motion()
   if climb == nil then
      finish("no estimate")
      return
   end
   test.y = test.y + 0.5 * (climb + test.climb) * (after - test.last_s)
   test.last_s, test.climb = after, climb
   test.rows[#test.rows + 1] = string.format("%.4f,%.4f,%.5f\n", after - test.relay_s, throttle, test.y)
   if now - test.relay_s > duration:get() then
      finish(nil)
   end
end

local function update()
   local position = rc:get_aux_cached(switch_function:get())
   if position ~= last_position and position ~= nil then
      local is_first = last_position == nil
      last_position = position
      if position == LOW and test ~= nil then
         finish("switch low")
      elseif position == HIGH and test == nil and not is_first then
         begin()
      end
   end
   if test ~= nil then
      tick()
   end
end

local function protected()
   local is_well, problem = pcall(update)
   if not is_well then
      say(WARNING, "error: %s", problem)
      if test ~= nil then
         pcall(finish, "error in the script")
         test = nil
      end
   end
   return protected, test ~= nil and PERIOD_MS or 100
end

return protected, 1000
