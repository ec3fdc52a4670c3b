"""From tracks of 3D boxes to ground truth: nearest corner, consensus velocity, choice by radar (paper, 4.2).

    annotation = annotate(read_tracks(Path("track.csv")))
    Path("truth.csv").write_text(annotation.text())

It needs only numpy.
"""
