# A test script for the C++ framework's Python plug-in, as it was written then.


class TestCase:
    def setup(self, param=""):  # noqa: ARG002 - the C++ framework gives it
        robottestingframework.setName("old script")  # noqa: F821 - the framework puts it here
        robottestingframework.testReport("setting up with " + robottestingframework.getEnvironment())  # noqa: F821
        return True

    def run(self):
        robottestingframework.testCheck(2 > 1, "two is more than one")  # noqa: F821

    def tearDown(self):
        robottestingframework.testReport("tearing down")  # noqa: F821
