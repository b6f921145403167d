"""What the judges of learned projects share: the truth, held-out views, their scores, and contact sheets.

Pictures are float [H, W, 3] in [0, 1], masks bool [H, W], both at the project's working size. Only test views count.
"""

HOLDOUT = 8  # of captures that declare no test photos, every so many-th: published figures are of these
