-- What runs before a Lua test, in its interpreter.
--
-- Called with the function behind the API, the one behind the hook, the script's chunk name and folder, and the number
-- of instructions between two looks for a stop. Returns three functions: `begin(code)` runs the script, `has(name)` says
-- whether `TestCase` has a function, `invoke(name, ...)` calls it. `begin` and `invoke` return kind, value, source, line
-- and traceback; the kind is `done`, `raised` (a Python exception), `failed` (a Lua error) or `unreadable` (a syntax
-- error).
--
-- Exceptions of Python (a failed assertion, a skip, a stop) travel through Lua as opaque error values: a script's `pcall`
-- catches them as any other error, and passed on they are still what they were.
local host, look, chunkname, folder, steps = ...
local traceback, getinfo, sethook = debug.traceback, debug.getinfo, debug.sethook
local error, type, tostring, getmetatable = error, type, tostring, getmetatable
local pcall, xpcall, load = pcall, xpcall, load
local main, stdout = coroutine.running(), io.stdout
local own = "=[rtf]"

-- The nearest frame that is the script's.
local function place()
    for level = 2, 200 do
        local info = getinfo(level, "Sl")
        if not info then break end
        if info.what ~= "C" and info.source ~= own then return info.source, info.currentline end
    end
    return "", 0
end

local function call(name, ...)
    local source, line = place()
    return host(name, source, line, ...)
end

-- A stop must come through a loop that never leaves Lua, and through any number of pcalls: once it is due it is raised
-- at every instruction of the script, until none is left to run.
local function tick()
    local fine, problem = pcall(look)
    if fine then return end
    sethook(tick, "", 1)
    sethook(main, tick, "", 1)
    if getinfo(2, "S").source ~= own then error(problem, 0) end
end

-- A coroutine has a hook of its own.
local function hooked(f)
    if type(f) ~= "function" then return f end
    return function(...)
        sethook(tick, "", steps)
        return f(...)
    end
end
local create, wrap = coroutine.create, coroutine.wrap
coroutine.create = function(f) return create(hooked(f)) end
coroutine.wrap = function(f) return wrap(hooked(f)) end

TestCase = {}
robottestingframework = {
    setName = function(name) call("setName", tostring(name)) end,
    testReport = function(text) call("testReport", tostring(text)) end,
    testCheck = function(condition, text) call("testCheck", condition and true or false, tostring(text)) end,
    testFailIf = function(condition, text)
        call("testFailIf", condition and true or false, tostring(condition), tostring(text))
    end,
    testFail = function(condition, text) call("testFailIf", false, tostring(condition), tostring(text)) end,
    assertError = function(text) call("assertError", tostring(text)) end,
    assertFail = function(text) call("assertFail", tostring(text)) end,
    getEnvironment = function() return (call("getEnvironment")) end,
    measure = function(name, value, unit, low, high) call("measure", tostring(name), value, unit, low, high) end,
    skip = function(text) call("skip", tostring(text)) end,
    progress = function(fraction, text) call("progress", fraction, tostring(text or "")) end,
}
package.loaded.robottestingframework = robottestingframework
package.path = folder .. "/?.lua;" .. package.path

os.exit = function(code) error("the script called os.exit(" .. tostring(code) .. ")", 2) end
stdout:setvbuf("line") -- the process ends without flushing what Lua holds
python = nil
package.loaded.python = nil

local function handler(problem)
    local source, line = place()
    local text = tostring(problem)
    if type(problem) == "table" and not (getmetatable(problem) or {}).__tostring then
        text = "the error value is a table"
    end
    local trace = traceback(text, 2):gsub("\n\t%(...tail calls...%)\n\t%[C%]: in function 'xpcall'\n\t%[rtf%].*$", "")
    local failed = {kind = "failed", value = text, source = source, line = line, trace = trace}
    if type(problem) == "userdata" then failed.kind, failed.value = "raised", problem end
    return failed
end

local function result(fine, value)
    sethook()
    stdout:flush()
    if fine then return "done", value and true or false end
    return value.kind, value.value, value.source, value.line, value.trace
end

local function begin(code)
    local chunk, problem = load(code, chunkname, "t")
    if not chunk then return "unreadable", problem end
    return result(xpcall(hooked(chunk), handler))
end

local function has(name)
    return type(TestCase) == "table" and type(TestCase[name]) == "function"
end

local function invoke(name, ...)
    return result(xpcall(hooked(TestCase[name]), handler, ...))
end

return begin, has, invoke
