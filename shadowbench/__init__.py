"""shadowbench: real-time shadow techniques, scored against ray tracing."""

__version__ = "0.1.0"
