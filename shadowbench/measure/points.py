"""Points of surfaces, followed from frame to frame by their triangle and barycentric coordinates."""

from collections.abc import Iterable

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scores.masks import Single
from shadowbench.scores.motion import Motion, Seen
from shadowbench.truths.trace import Truth


class Points:
    """The points that are followed through the truths of a sequence, at first one at each pixel's centre.

    One serves any number of masks of the same frames: what it returns depends on the truths alone.
    """

    def see(self, truth: Truth) -> Seen:
        """The points in the next frame. Raises ValueError for a truth without a view, or of another size or geometry."""
        raise NotImplementedError


def motion_scores(frames: Iterable[tuple[Single, Truth]]) -> dict[str, float | None]:
    """`Motion.scores` of masks (H, W) and their truths, in order."""
    motion, points = Motion(), Points()
    for mask, truth in frames:
        motion.add(mask, prepare_truth(truth), points.see(truth))
    return motion.scores()
