"""Words for a person in place of the names of stages in summaries and caches."""

WORDS = {
    "search": "sizes of elements",
    "model": "stiffness and mass",
    "tuning-basis": "basis of the fit",
    "factor": "factors of the stiffness",
    "krylov-space": "search for modes",
    "mac": "comparison of modes",
    "contact": "contact patch",
    "joint-bounds": "limits of bolted joints",
    "backbones": "loops of friction",
    "amplitudes": "modes at their amplitudes",
    "reduction": "reduction to the contact",
    "second-mesh": "second mesh",
    "missed-energy": "errors of frequencies",
    "full-response": "response of the full model",
    "response": "response at the contact",
    "pictures": "pictures of modes",
    "figures": "plots",
    "other-theories": "other theories",
    "theory-error": "error of the theory",
    "reduction-error": "error of the reduction",
    "mesh-error": "error of the mesh",
    "quantity-errors": "errors of peaks and times",
    "part-errors": "errors of measured parts",
    "receptance-error": "error of the receptance",
    "record": "record of sensors",
    "signals": "plots of sensors",
    "chain-contacts": "contacts of the chains",
    "chains-before": "cycle under the shakers",
    "chains-march": "march of the chains",
    "chains-waves": "waves of the chains",
    "chains-errors": "error of the reduction",
    "chains-mesh-errors": "error of the mesh",
    "chains-figures": "plots",
    "row-contacts": "contacts of the last row",
    "crystal-error": "error of the reduction",
    "crystal-march": "march of the crystal",
    "crystal-modes": "modes of the crystal",
    "crystal-figures": "plots",
    "spatial-wall": "wall in three directions",
}


def stage_words(name: str) -> str:
    """Words for a stage; a name in brackets, or one that is not listed, stays as it is."""
    stage, bracket, bracketed = name.partition(" (")
    return WORDS.get(stage, stage) + bracket + bracketed
