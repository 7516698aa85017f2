"""How wrong a mask is: masks as files, the truth as scores see it, and the table of metrics. Knows only arrays."""

from shadowbench.scores.masks import mask_sha256, quantise, read_mask, write_mask
from shadowbench.scores.metrics import METRICS, Metric, score
from shadowbench.scores.reference import Reference

__all__ = ["METRICS", "Metric", "Reference", "mask_sha256", "quantise", "read_mask", "score", "write_mask"]
