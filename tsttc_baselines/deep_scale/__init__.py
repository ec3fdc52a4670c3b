"""Deep Scale (§5.2), the paper's network: weights of this project, or the dataset's own, without torch."""

# `estimator` is the baseline. Only `training` and `torch_layers` need torch.
