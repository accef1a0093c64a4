#!/usr/bin/env python3
"""A program that writes results in the shape of GoogleTest, where GTEST_OUTPUT says."""

import os
import sys

print("[==========] Running 4 tests from 1 test suite.")
kind, _, path = os.environ["GTEST_OUTPUT"].partition(":")
assert kind == "xml" and os.environ["GTEST_COLOR"] == "no"
failing = "--fail" in sys.argv
failure = """
      <failure message="/src/joint_test.cc:12&#x0A;Expected equality of these values:&#x0A;  a&#x0A;  b" type=""><![CDATA[/src/joint_test.cc:12
Expected equality of these values:
  a
  b]]></failure>
"""
with open(path, "w") as stream:
    stream.write(
        f"""<?xml version="1.0" encoding="UTF-8"?>
<testsuites tests="4" failures="{int(failing)}" disabled="1" errors="0" time="0.01" name="AllTests">
  <testsuite name="Joint" tests="4" failures="{int(failing)}" disabled="1" skipped="1" errors="0" time="0.01">
    <testcase name="Moves" file="/src/joint_test.cc" line="5" status="run" result="completed" time="0.25" classname="Joint" />
    <testcase name="Stops" status="run" result="completed" time="0." classname="Joint">{failure if failing else ""}</testcase>
    <testcase name="Brakes" status="run" result="skipped" time="0." classname="Joint">
      <skipped message="/src/joint_test.cc:20&#x0A;no brake"><![CDATA[/src/joint_test.cc:20
no brake]]></skipped>
    </testcase>
    <testcase name="DISABLED_Burns" status="notrun" result="suppressed" time="0." classname="Joint" />
  </testsuite>
</testsuites>
"""
    )
sys.exit(int(failing))
