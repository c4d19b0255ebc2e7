"""Ratios of the benchmarks beside their bars and beside those of the last release.

    make bench | python -m tests.benchmarks.ratios RELEASE

records what `make bench` has printed as the ratios of a release, in tests/benchmarks/released.json.
"""

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
    if len(sys.argv) != 2:
        sys.exit("usage: make bench | python -m tests.benchmarks.ratios RELEASE")
    text = ""
    for row in sys.stdin:
        print(row, end="", flush=True)
        text += row
    ratios = json.loads(RELEASED.read_text(encoding="utf-8"))["ratios"] | ratios_of(text)
    RELEASED.write_text(json.dumps({"release": sys.argv[1], "ratios": ratios}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
