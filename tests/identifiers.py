"""An identifier whose scene is not to be used."""

from __future__ import annotations

import numpy as np

from graspsense.core.components.identification import CandidateScore, Identification, SqueezeFit, Undetermined

SCENE = "width_m = 0.05\n"


def undecided(config, squeezes, progress, block) -> Identification:
    """Return a scene with a number that the squeezes do not determine."""
    del config, progress, block
    times = np.linspace(0.0, 1.0, 5)
    fit = SqueezeFit(
        name=squeezes[0].name,
        t_s=times,
        compression_m=times,
        measured_n=times,
        fitted_n=times,
        rms_n=0.1,
        peak_n=1.0,
    )
    return Identification(
        label="",
        scene=SCENE,
        parameters=(),
        candidates=(
            CandidateScore(
                terms="elastic (k1)", parameters=1, error=0.1, fit_error=0.1, verdict="chosen", chosen=True
            ),
        ),
        undetermined=(Undetermined(what="k2", reason="too wide", remedy="squeeze deeper", in_scene=True),),
        fits=(fit,),
        refusals=("k2 is not determined: too wide; squeeze deeper",),
    )
