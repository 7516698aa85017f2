"""Search for parameters of a shadow map that are better than its defaults, with Optuna: pip install optuna

    python examples/tune.py [TRIALS]

Each trial is measured on the scenes of the search; the best setting and the default are then scored on scenes that the
search did not use. The error is √((1 − IoU) · (1 − SSIM)), as a geometric mean over scenes. A stopped search goes on.
"""

import sys

import numpy as np
import optuna

import shadowbench as sb

SEARCHED = ["cube-on-plane", "stairs", "statue", "colonnade"]
HELD_OUT = ["street", "terrain"]


def error(spec: str, scenes: list[str]) -> float:
    """The error of a spec."""
    rows = sb.run(scenes, spec, map_size=[1024], view_size=256, rounds=0, folder="results/tune")
    rows = rows[rows["status"] == "ok"]
    iou, ssim = (np.maximum(1 - rows[name], 1e-4) for name in ("iou", "ssim"))
    return float(np.exp(np.log(iou * ssim).mean() / 2))


def setting(trial: optuna.Trial) -> float:
    """The error of a setting that Optuna suggests."""
    bias = trial.suggest_categorical("bias", ["texel", "slope", "constant", "normal-offset"])
    texel = f"(limit={trial.suggest_float('limit', 2, 64, log=True):.3g})" if bias == "texel" else ""
    chosen = trial.suggest_categorical("filter", ["hard", "hardware", "pcf", "pcf(taps=5)"])
    spec = f"shadow-map:bias={bias}{texel},filter={chosen}"
    trial.set_user_attr("spec", spec)
    return error(spec, SEARCHED)


def main() -> None:
    """Search, then print the errors of the best setting and of the default."""
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    study.optimize(setting, n_trials=int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    for spec in dict.fromkeys([study.best_trial.user_attrs["spec"], "shadow-map"]):
        print(f"{error(spec, SEARCHED):.4g} searched, {error(spec, HELD_OUT):.4g} held out: {spec}")


if __name__ == "__main__":
    main()
