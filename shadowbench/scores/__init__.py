"""Image metrics of shadow masks against a truth, and masks as files. Works on arrays only."""

from shadowbench.scores.comparison import PreparedTruth
from shadowbench.scores.masks import mask_sha256, quantise, read_mask, write_mask
from shadowbench.scores.metrics import METRICS, Metric, score

__all__ = ["METRICS", "Metric", "PreparedTruth", "mask_sha256", "quantise", "read_mask", "score", "write_mask"]
