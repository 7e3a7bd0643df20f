-- Gains from a parameter file in flight: tried, kept or dropped by a switch of three positions. For unmodified ArduPilot.
--
-- `onecycle identify LOG --write onecycle.param` makes the file (lines NAME,VALUE); put it beside this script, into APM/scripts.
-- The switch is an auxiliary function (RCn_OPTION), 301 unless OCP_FUNC says otherwise:
--   middle: the file's values are in force, not saved
--   high:   they are saved
--   low:    the old values are in force again
-- Landing and disarming before they are saved brings the old values back. Every value is read back after it was written. A file
-- with an unknown parameter, a parameter that is no gain, or a line that is not NAME,VALUE changes nothing.

local FILES = { "/APM/scripts/onecycle.param", "scripts/onecycle.param" }
local GAINS = { "^ATC_", "^PSC_", "^Q_A_", "^Q_P_" }  -- names of attitude and position gains begin so
local MOST_LINES = 40
local LOW, MIDDLE, HIGH = 0, 1, 2
local WARNING, NOTICE = 4, 5

assert(param:add_table(88, "OCP_", 1), "onecycle: no parameter table")
assert(param:add_param(88, 1, "FUNC", 301), "onecycle: no parameter")
local switch_function = Parameter("OCP_FUNC")

local old = nil        -- name to old value while new values are in force and not saved
local order = {}       -- names as the file has them
local last_position = nil

local function say(severity, ...)
   gcs:send_text(severity, "onecycle: " .. string.format(...))
end

local function is_gain(name)
   for _, pattern in ipairs(GAINS) do
      if name:find(pattern) then
         return true
      end
   end
   return false
end

-- Equal in single precision.
local function is_equal(a, b)
   return a ~= nil and math.abs(a - b) <= 1e-6 * math.max(math.abs(a), math.abs(b), 1e-6)
end

-- The name and the value of a line, nil for an empty one, or nil and a problem.
local function parse(line)
   line = line:gsub("#.*", ""):gsub("%s+$", ""):gsub("^%s+", "")
   if line == "" then
      return nil
   end
   local name, text = line:match("^([%w_]+)[,%s]+([%d%.eE+-]+)$")
   local value = tonumber(text)
   if value == nil then
      return nil, "not NAME,VALUE"
   elseif not is_gain(name) then
      return nil, name .. " is no gain"
   elseif param:get(name) == nil then
      return nil, "no parameter " .. name
   end
   return name, value
end

-- Names in their order and values by name, or nil and a problem.
local function read()
   local file
   for _, path in ipairs(FILES) do
      file = file or io.open(path, "r")
   end
   if file == nil then
      return nil, "no file onecycle.param"
   end
   local names, values, number, problem = {}, {}, 0, nil
   for line in file:lines() do
      number = number + 1
      local name, value = parse(line)
      if name == nil and value ~= nil then
         problem = string.format("line %d: %s", number, value)
      elseif name ~= nil and values[name] ~= nil then
         problem = string.format("line %d: %s again", number, name)
      elseif name ~= nil then
         names[#names + 1], values[name] = name, value
      end
      if number > MOST_LINES then
         problem = "more than " .. MOST_LINES .. " lines"
      end
      if problem ~= nil then
         break
      end
   end
   file:close()
   if problem == nil and #names == 0 then
      problem = "onecycle.param is empty"
   end
   return problem == nil and names or nil, problem or values
end

local function restore(why)
   for _, name in ipairs(order) do
      if old[name] ~= nil then
         param:set(name, old[name])
         if not is_equal(param:get(name), old[name]) then
            say(WARNING, "%s is not as it was", name)
         end
      end
   end
   old = nil
   say(WARNING, "%s: old values", why)
end

local function put_in_force()
   if not arming:is_armed() then
      say(WARNING, "arm first; nothing changed")
      return
   end
   local names, values = read()
   if names == nil then
      say(WARNING, "%s; nothing changed", values)
      return
   end
   old, order = {}, names
   for _, name in ipairs(names) do
      old[name] = param:get(name)
      if not (param:set(name, values[name]) and is_equal(param:get(name), values[name])) then
         restore(name .. " not written")
         return
      end
   end
   say(NOTICE, "%d values in force; high saves, low drops", #names)
end

local function save()
   for _, name in ipairs(order) do
      if not param:set_and_save(name, param:get(name)) then
         restore(name .. " not saved")
         return
      end
   end
   old = nil
   say(NOTICE, "%d values saved", #order)
end

local function update()
   if old ~= nil and not arming:is_armed() then
      restore("disarmed before they were saved")
   end
   local position = rc:get_aux_cached(switch_function:get())
   if position == last_position or position == nil then
      return
   end
   -- A switch that is not low at the start moves nothing.
   local is_first = last_position == nil
   last_position = position
   if position == LOW and old ~= nil then
      restore("switch low")
   elseif position == MIDDLE and old == nil and not is_first then
      put_in_force()
   elseif position == HIGH and old ~= nil then
      save()
   elseif position == HIGH and not is_first then
      say(WARNING, "no values to save; nothing changed")
   end
end

local function protected()
   local is_well, problem = pcall(update)
   if not is_well then
      say(WARNING, "%s", problem)
      if old ~= nil then
         restore("error in the script")
      end
   end
   return protected, 100
end

return protected, 1000
