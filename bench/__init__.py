"""Side-by-side measurements: one script per claim of docs/benchmarks.md."""
