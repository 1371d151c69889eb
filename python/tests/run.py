#!/usr/bin/env python3
"""run.py ARGUMENT...: pytest with these arguments, for ctest.

Exits with 77, which ctest shows as skipped, where numpy or pytest are missing, there is no device, or
all tests were skipped.
"""

import sys

try:
    import numpy  # noqa: F401
    import pytest
except ImportError as error:
    print(f"skipped: {error} (Debian: python3-numpy, python3-pytest)")
    sys.exit(77)


class Tally:
    passed = 0
    skipped = 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.passed += report.when == "call" and report.passed
        self.skipped += report.skipped


tally = Tally()
code = pytest.main(["-q", "-rs", "-p", "no:cacheprovider", *sys.argv[1:]], plugins=[tally])
if code == 0 and tally.passed == 0:
    code = 77
sys.exit(code)
