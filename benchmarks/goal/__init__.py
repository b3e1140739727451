"""Poses from one picture of a goal: accuracy, time, and what a wrong camera file costs."""
