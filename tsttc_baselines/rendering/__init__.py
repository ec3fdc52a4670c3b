"""Frames of simulated sequences: the rear of a vehicle on a road, as a camera sees it.

    from tsttc_baselines.rendering.clips import render
    rendered = render(split, anno_id=17, seed=20230904)
    rendered.clip, rendered.images

Everything follows from (seed, anno_id), so any sequence can be rendered alone.
"""
