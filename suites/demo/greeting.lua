-- A Lua test with the API of the C++ framework, unchanged.

TestCase.setup = function(parameter)
    robottestingframework.setName("lua greeting")
    robottestingframework.testReport("parameter: " .. parameter)
    return true
end

TestCase.run = function()
    robottestingframework.testCheck(string.upper("hello") == "HELLO", "strings are shouted correctly")
end

TestCase.tearDown = function()
    robottestingframework.testReport("good-bye")
end
