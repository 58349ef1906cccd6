"""What `bench/fuzz.py` and the tests share: every reader of files, seeds drawn for it, and what a sane result is."""
