"""Jobs for a render farm, as Open Job Description has them: bundles that any farm, or `openjd run`, can work off."""
