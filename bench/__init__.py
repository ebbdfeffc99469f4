"""Benchmarks that print ratios within one run, and figures on real data."""
