"""What the judges of learned projects share: the truth, held-out views, their scores, and contact sheets.

Pictures are float [H, W, 3] in [0, 1], masks bool [H, W], both at the project's working size. Only test views count.
"""

HOLDOUT = 8  # every 8th photo is a test photo where a capture declares none, as in published figures
