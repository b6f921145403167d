"""A camera's frames as a job for a render farm: all that the job needs is in one folder."""

import json

import pytest


@pytest.fixture
def filmed(bpy, addon, learned):
    """The learned scene with a camera, four frames and a swatch that changes over them."""
    camera = bpy.data.objects.new("Path", bpy.data.cameras.new("Path"))
    learned.collection.objects.link(camera)
    learned.camera = camera
    learned.frame_start, learned.frame_end = 11, 14
    swatch = learned.karf.objects[0].swatches[1]
    for frame, color in ((11, (0.2, 0.4, 0.6)), (14, (0.8, 0.4, 0.2))):
        swatch.color = color
        swatch.keyframe_insert("color", frame=frame)
    return learned


def parameters(bundle):
    template = json.loads((bundle / "template.json").read_text())
    return {entry["name"]: entry["default"] for entry in template["parameterDefinitions"]}


def test_the_job_has_the_cameras_and_the_swatches_of_each_frame(addon, filmed, tmp_path):
    bundle = addon.steps.farm_bundle(filmed, out=tmp_path / "job", per_task=3)
    names = [f"frame_{number:04d}" for number in range(11, 15)]
    frames = json.loads((bundle / "cameras.json").read_text())["frames"]
    assert [frame["file_path"] for frame in frames] == names
    edits = {path.stem: json.loads(path.read_text())["objects"] for path in (bundle / "edits").iterdir()}
    assert sorted(edits) == names
    assert edits["frame_0011"] != edits["frame_0014"]
    told = parameters(bundle)
    assert (told["FirstFrame"], told["LastFrame"], told["FramesPerTask"]) == (1, 4, 3)


def test_the_job_renders_as_the_panel_says(addon, filmed, tmp_path):
    filmed.karf.file_format, filmed.karf.color_depth, filmed.karf.color_mode = "OPEN_EXR", "16", "RGBA"
    bundle = addon.steps.farm_bundle(filmed, out=tmp_path / "job")
    (step,) = json.loads((bundle / "template.json").read_text())["steps"]
    arguments = " ".join(step["script"]["actions"]["onRun"]["args"])
    assert "--base render --alpha --format exr16" in arguments


def test_the_button_writes_a_new_folder_each_time(bpy, addon, filmed):
    for name in ("Path", "Path_2"):
        assert bpy.ops.karf.farm_bundle(per_task=2) == {"FINISHED"}
        bundle = addon.folders.out_folder(filmed) / "farm" / name
        assert (bundle / "engine" / "karf_engine" / "__main__.py").is_file()
        assert (bundle / "project" / "project.json").is_file()


def test_without_a_camera_the_button_says_so(bpy, addon, filmed):
    filmed.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.karf.farm_bundle()
