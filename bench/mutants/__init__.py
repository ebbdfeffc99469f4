"""Would the tests notice? Faults are put into copies of the sources, one at a time.

``python -m bench.mutants`` (``make mutants``) runs the named ones and a sample drawn by a seed, and
prints which survive; ``docs/explain/mutants.md`` says what the last run found.
"""
