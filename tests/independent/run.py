"""Evaluates the equations of the three papers without this project's code and compares them with recordings of the virtual device, and
gives the diagnosis recordings in which nothing is missing.

    python tests/independent/run.py PROGRAM

PROGRAM is the built host-sim. Needs NumPy and SciPy. Each check prints a line with the difference found and the difference allowed;
the exit status is 1 where one fails. The equations are written from the papers, without reading the control law; where a paper leaves a
number open, the number is in the patient that the check itself writes.
"""

import sys
import tempfile
import time

import anatomy
import body
import fem
import paper_000
import paper_001
import paper_002
import skew
import xpbd
from device import Device, Report


def main(program):
    report, begun = Report(), time.monotonic()
    for part in (paper_000, fem, paper_001, paper_002, anatomy, body, skew, xpbd):
        with tempfile.TemporaryDirectory() as folder:
            part.check(Device(program, folder), report)
    verdict = "pass" if report.failures == 0 else f"{report.failures} checks failed"
    print(f"independent: {verdict} ({time.monotonic() - begun:.0f} s)")
    return report.failures != 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: run.py PROGRAM, the built host-sim")
    sys.exit(main(sys.argv[1]))
