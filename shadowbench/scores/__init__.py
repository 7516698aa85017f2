"""How wrong a mask is: masks as files, the truth as scores see it, and the table of metrics. Knows only arrays."""

from shadowbench.scores.masks import mask_sha256, quantise, read_mask, write_mask
from shadowbench.scores.metrics import METRICS, Metric, score
from shadowbench.scores.prepared import PreparedTruth

__all__ = ["METRICS", "Metric", "PreparedTruth", "mask_sha256", "quantise", "read_mask", "score", "write_mask"]
