"""A script of the C++ framework: no import, the module is among the globals once the script is loaded."""


class TestCase:
    def setup(self, param):
        robottestingframework.setName("classic")
        robottestingframework.testReport("param is " + param)
        robottestingframework.testReport("environment is " + robottestingframework.getEnvironment())
        return True

    def run(self):
        robottestingframework.testCheck(2 + 2 == 4, "sums")
        robottestingframework.testCheck(2 + 2 == 5, "wrong sums")
        robottestingframework.testFailIf(True, "not told")
        robottestingframework.testFailIf(False, "told")
        robottestingframework.testFail("a > b", "always told")

    def tearDown(self):
        robottestingframework.testReport("torn down")
