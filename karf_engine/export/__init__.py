"""What other programs take over: pictures in layers, and mattes by the Cryptomatte specification."""
