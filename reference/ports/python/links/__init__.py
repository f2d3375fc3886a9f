"""The robot links, a module each: `Decoder` and `encode` (README.md of the folder above)."""
