"""The pipeline: stages kept by content, computed on demand."""
