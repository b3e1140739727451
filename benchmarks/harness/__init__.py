"""What all programs have in common: arguments, tables, verdicts, files of figures, and their comparison."""

from benchmarks.harness.figures import Kind
from benchmarks.harness.report import DEFAULT_SEED, Table, finish, judge, parse_arguments, percent, verdict

__all__ = ["DEFAULT_SEED", "Kind", "Table", "finish", "judge", "parse_arguments", "percent", "verdict"]
