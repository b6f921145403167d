"""The metrics of all tables: one registry of their titles, formats and meanings, and the functions that compute them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Metric:
    """A column of a table: its title, the format of its values, and what it is, for the benchmark's page."""

    title: str
    format: str
    meaning: str = ""


_IOU = "intersection over union of a mask with the true one, percent; mean over test views that show the object, then objects"
_CIEDE = "CIEDE2000 to the true recolor inside the edited objects' true masks, mean over test views, then edits"
_OUTSIDE = "mean squared error outside the edited objects' true masks, colors in [0, 1]"
_PATH = "RMSE between what two frames of a camera path show of the same surface points"
METRICS = {
    "psnr": Metric("PSNR", ".1f", "of learned views against held-out photos, dB; mean over views"),
    "psnr_worst": Metric("PSNR worst", ".1f", "PSNR of the worst held-out photo"),
    "psnr_splats": Metric("PSNR splats", ".1f", "PSNR of the splats"),
    "psnr_splats_worst": Metric("splats worst", ".1f", "PSNR of the splats in the worst held-out photo"),
    "iou": Metric("IoU", ".1f", _IOU),
    "iou_border": Metric("border left out", ".1f", "IoU without the pixels that touch the true border"),
    "iou_worst": Metric("worst view", ".1f", "IoU of the worst view, mean over objects"),
    "iou_pooled": Metric("pooled", ".1f", "IoU of the pixels of all views counted together"),
    "iou_ceiling": Metric("ceiling", ".1f", "IoU from the true masks of all training views, in the same geometry"),
    "iou_photo": Metric("IoU, mattes", ".1f", "IoU of the mattes that photos are recolored with"),
    "accuracy": Metric("accuracy", ".2f", "share of all pixels that a mask gets right, percent"),
    "ciede2000": Metric("CIEDE2000", ".2f", _CIEDE),
    "ciede2000_median": Metric("median", ".2f", "median of the CIEDE2000 over scenes"),
    "ciede2000_per_paint": Metric(
        "a pair per paint", ".2f", "CIEDE2000, told one color pair for each paint of an object"
    ),
    "ciede2000_per_object": Metric("a pair per object", ".2f", "CIEDE2000, told one color pair for each object"),
    "ciede2000_hue_per_paint": Metric("hue shift, per paint", ".2f", "hue shifts by the same pairs in the true masks"),
    "ciede2000_hue": Metric("hue shift, per object", ".2f", "a hue shift by the same pair in the true masks"),
    "ciede2000_no_edit": Metric("no edit", ".1f", "CIEDE2000 of the photo itself"),
    "psnr_recolored": Metric("PSNR", ".1f", "of recolored photos against the true recolors, whole picture, dB"),
    "mse_outside": Metric("MSE outside", ".1e", _OUTSIDE + ", against the picture before the edit"),
    "mse_outside_photo": Metric("against the photo", ".1e", _OUTSIDE + ", against the photo"),
    "mse_outside_worst": Metric("worst view", ".1e", "MSE outside, of the worst view"),
    "rmse_short": Metric("RMSE, 1 frame", ".4f", _PATH + ", 1 frame (2.5 degrees) apart"),
    "rmse_long": Metric("RMSE, 7 frames", ".4f", _PATH + ", 7 frames apart"),
    "ratio_short": Metric("ratio, 1 frame", ".2f", "RMSE over that of the same frames without the edit"),
    "ratio_long": Metric("ratio, 7 frames", ".2f", "RMSE over that of the same frames without the edit"),
    "flicker": Metric("flicker", ".4f", "deviation of a frame from its two neighbors at the same surface points"),
    "flow_short": Metric("flow, 1 frame", ".4f", "RMSE by optical flow (Lai et al. 2018, DIS flow), 1 frame apart"),
    "flow_long": Metric("flow, 7 frames", ".4f", "RMSE by optical flow, 7 frames apart"),
    "psnr_frame": Metric("PSNR frame", ".2f", "of the objects as palettes and F_w mix them on black, dB; the paper's"),
    "psnr_object": Metric("PSNR object", ".2f", "PSNR frame inside the true masks only"),
    "ssim_object": Metric("SSIM object", ".4f", "SSIM inside the true masks only"),
    "parameters": Metric("parameters", ",d", "of the head"),
    "difference": Metric("difference", "", "mean difference to the first row over captures, dB, ± standard deviation"),
    "better_on": Metric("better on", "", "number of captures with a higher mean than the first row"),
    "seconds": Metric("CPU s", ".0f", "processor seconds"),
    "milliseconds": Metric("ms", ".1f", "processor milliseconds, median"),
    "times_faster": Metric("times faster", ".1f", "than the first row, measured in one process"),
}
