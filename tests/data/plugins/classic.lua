-- A script of the C++ framework.

TestCase.setup = function(parameter)
    robottestingframework.setName("classic")
    robottestingframework.testReport("param is " .. parameter)
    robottestingframework.testReport("environment is " .. robottestingframework.getEnvironment())
    return true
end

TestCase.run = function()
    robottestingframework.testCheck(2 + 2 == 4, "sums")
    robottestingframework.testCheck(2 + 2 == 5, "wrong sums")
    robottestingframework.testFailIf(true, "not told")
    robottestingframework.testFailIf(false, "told")
    robottestingframework.testFail("a > b", "always told")
end

TestCase.tearDown = function()
    robottestingframework.testReport("torn down")
end
