"""A recommendation in sentences: what the next steps cost, what stands in the way, what was left out."""

from collections.abc import Iterator

from shadowbench.advice.recommend import Recommendation
from shadowbench.advice.search import Tried

_KINDS = {
    "contact": "of the shadow next to its caster is lit",
    "leak": "of the umbra is lit",
    "acne": "of what is lit is dark",
}


def step_lines(found: Recommendation) -> list[str]:
    """What relaxing the target would save and tightening it would cost, among what was measured."""
    choice, target = found.choice, found.target
    assert choice is not None
    lines = []
    if found.cheaper is not None:
        saved = 1 - found.cheaper.cost / choice.cost
        lines.append(
            f"relaxing the target to {target.text(found.cheaper.error)} saves {saved:.0%}: {_name(found.cheaper)}"
        )
    else:
        lines.append("relaxing the target: nothing measured costs at least a tenth less")
    if found.better is not None:
        times = found.better.cost / choice.cost
        lines.append(
            f"tightening it to {target.text(found.better.error)} costs {times:.3g} × as much: {_name(found.better)}"
        )
    elif choice.error > 0:
        lines.append("tightening it: nothing measured has less than half the error")
    return lines


def in_the_way(found: Recommendation) -> list[str]:
    """Why nothing meets the target."""
    return list(_obstacles(found))


def _obstacles(found: Recommendation) -> Iterator[str]:
    target, near, needs = found.target, found.closest, found.needs
    if near is None or near.result is None:
        yield f"nothing meets {target}: nothing held; {'; '.join(found.refused.values())}"
        return
    met = [one for one in found.tried if one.error <= target.limit]
    yield f"nothing meets {target}; the closest is {_name(near)}: {target.text(near.error)}"
    if met and target.budget_ms is not None:
        yield f"obstacle: the budget; {_name(met[0])} reaches {target.text(met[0].error)} in {met[0].cost:.3g} ms"
        return
    metrics = near.result.score["metrics"]
    kinds = {kind: metrics[kind] for kind in _KINDS if metrics[kind]}
    if kinds:
        worst = max(kinds, key=lambda kind: kinds[kind])
        yield f"obstacle: {worst}, {kinds[worst]:.2%} {_KINDS[worst]}"
    size = (needs.texels.edge_size or needs.texels.size).value
    largest = max((one.spec.map_size or 0 for one in found.tried), default=0)
    if largest and size > largest:
        yield f"obstacle: map size; exact edges need about {size:.0f} texels a side, the largest tried has {largest}"


def excluded_lines(found: Recommendation) -> list[str]:
    """What was not tried, and why."""
    lines = []
    for one in found.excluded:
        count = f" ({one.specs} specs)" if one.specs > 1 else ""
        lines.append(f"not tried: {one.what}{count}: {one.why}")
    rest = found.whole - found.measured - sum(one.specs for one in found.excluded)
    if rest > 0:
        why = "to cost more than the choice, or to miss the target" if found.choice else "to miss the target"
        lines.append(f"not tried: {rest} more specs: predicted from those measured {why}")
    return [*lines, *(f"no result: {spec}: {status}" for spec, status in found.refused.items())]


def _name(one: Tried) -> str:
    size = f" at {one.spec.map_size}" if one.spec.map_size else ""
    return one.spec.sizeless_text + size
