"""Deep Scale (§5.2), the paper's network: weights of this project, or the dataset's own, without torch.

`estimator` is the baseline; `training` makes weights and is the only module that needs torch, beside
`torch_layers`.
"""
