"""Ratios of the benchmarks beside their bars and beside those of the last release.

    make bench | python -m tests.benchmarks.ratios RELEASE

records what `make bench` has printed as the ratios of a release, in tests/benchmarks/released.json.
"""

import argparse
import json
import re
import sys
from pathlib import Path

RELEASED = Path(__file__).with_name("released.json")
"""Name of the last release, and its ratios by their names."""
LINE = re.compile(r"^(?P<name>[^:]+): (?P<ratio>\d+\.\d+) times \(bar ")


def line(name: str, ratio: float, bar: float, least: bool = False) -> str:
    """Return a line of a benchmark: a ratio, its bar, whether it is met, and the last release's ratio.

    least: the ratio is to be at least the bar, otherwise at most.
    """
    is_met = ratio >= bar if least else ratio <= bar
    released = json.loads(RELEASED.read_text(encoding="utf-8"))
    before = released["ratios"].get(name)
    compared = "not measured" if before is None else f"{before:.2f}"
    relation, verdict = "at least" if least else "at most", "met" if is_met else "MISSED"
    return f"{name}: {ratio:.2f} times (bar {relation} {bar:.2f}, {verdict}; {released['release']}: {compared})"


def ratios_of(text: str) -> dict[str, float]:
    """Return the ratios of lines of benchmarks by their names."""
    matches = (LINE.match(row) for row in text.splitlines())
    return {match["name"]: float(match["ratio"]) for match in matches if match}


def main() -> None:
    """Pass on what is read, and record its ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("release")
    release = parser.parse_args().release
    text = ""
    for row in sys.stdin:
        print(row, end="", flush=True)
        text += row
    measured = ratios_of(text)
    if not measured:
        sys.exit("ratios: none was read, and none is recorded: pass on what `make bench` prints")
    ratios = json.loads(RELEASED.read_text(encoding="utf-8"))["ratios"] | measured
    RELEASED.write_text(json.dumps({"release": release, "ratios": ratios}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
