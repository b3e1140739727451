"""What all programs have in common: arguments, tables, verdicts, files of figures, and their comparison."""

from benchmarks.harness.figures import Kind
from benchmarks.harness.pool import Pool
from benchmarks.harness.report import DEFAULT_SEED, Table, judge, percent, program, verdict

__all__ = ["DEFAULT_SEED", "Kind", "Pool", "Table", "judge", "percent", "program", "verdict"]
