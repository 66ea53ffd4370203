"""Whether a deformation folds the model: proofs, counterexamples, largest safe scale of edits."""
