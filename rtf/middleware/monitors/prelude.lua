-- Closes what a monitor has no business with, and bounds each of its calls. Called with the host's functions.
local host, chunk, code, budget = ...
local sethook, getinfo, error, load, pcall = debug.sethook, debug.getinfo, error, load, pcall

for _, name in ipairs { "os", "io", "package", "require", "dofile", "loadfile", "load", "debug", "coroutine", "python",
                        "collectgarbage" } do
  _G[name] = nil
end
string.dump = nil

PortMonitor = {}
for name, value in pairs(host.monitor) do PortMonitor[name] = value end
yarp = {}
for name, value in pairs(host.yarp) do yarp[name] = value end
require = function(name)
  if name == "yarp" then return yarp end
  error("a port monitor may require yarp only, not " .. tostring(name), 2)
end

local function stop()
  local at = getinfo(2, "Sl")
  if at.short_src ~= "[rtf]" then
    error(at.short_src .. ":" .. at.currentline .. ": more than " .. budget .. " instructions in a call", 0)
  end
end

-- When the budget is used up, every further instruction is an error, so that no handler of the script goes on.
local function bounded(called, ...)
  sethook(function() sethook(stop, "", 1) end, "", budget)
  return called(...)
end

local function call(called, ...)
  local done, answer = pcall(bounded, called, ...)
  sethook()
  return done, answer
end

local loaded, reason = load(code, chunk, "t")
if not loaded then return false, reason end
local done, problem = call(loaded)
if not done then return false, problem end

return true, function(name) return type(PortMonitor[name]) == "function" end,
  function(name, ...) return call(PortMonitor[name], ...) end
