"""Where things are that tests read: the project's own scripts, and real parts that may be absent."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
BENCHMARKS = ROOT / "benchmarks"
CASES = ROOT.parent / "shared" / "cases"
