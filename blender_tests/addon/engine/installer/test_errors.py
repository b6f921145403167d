"""What pip and uv say when they fail, as sentences."""

import sys

import pytest

PIP_HASH = """Collecting uv==0.13.9
ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.
    uv==0.13.9 from file:///wheels/uv.whl (from -r uv.txt (line 1)):
        Expected sha256 aa
             Got        bb"""
CERTIFICATE = "error: Request failed after 3 retries\n  cause: invalid peer certificate: UnknownIssuer"
PIP_NETWORK = """WARNING: Retrying: Failed to establish a new connection: [Errno -3] Temporary failure in name resolution
ERROR: No matching distribution found for uv==0.13.9"""


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (PIP_HASH, "uv==0.13.9 is not the file that KaRF was tested with"),
        (CERTIFICATE, "The certificate of "),
        (PIP_NETWORK, "No connection to .*temporary failure in name resolution"),
        ("error: failed to write\n  cause: No space left on device (os error 28)", "The disk of .* is full"),
        ("error: No solution found when resolving dependencies", "A file that the engine needs is not to be had from"),
        ("error: something new\n", r"Installing packages failed \(exit code 2\): something new"),
        ("", r"Installing packages failed \(exit code 2\): it said nothing"),
    ],
)
def test_each_failure_is_a_sentence_with_a_remedy(managed, planned, said, sentence):
    plan = planned()
    error = managed.installation.explain(plan, plan.steps()[-1], said.splitlines(), "exit code 2")
    assert error.hint.endswith("Install goes on from there.")
    with pytest.raises(managed.api.KarfError, match=sentence):
        raise error


def test_where_torchs_own_index_cannot_be_reached_the_usual_one_is_offered(managed, tmp_path):
    for devices, is_offered in ((), True), (("cuda",), False):
        here = managed.computer.Machine("linux-x86_64", devices)
        plan = managed.plan.make(managed.plan.Choices(tmp_path / "engine"), sys.executable, True, {"PATH": ""}, here)
        error = managed.installation.explain(plan, plan.steps()[-1], ["dns error"], "exit code 2")
        assert ("build cuda" in error.hint) == ("torch's own index" in error.sentence) == is_offered
