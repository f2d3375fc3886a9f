"""Robot links: a package for each link, with its codec and its two ends. See README.md."""
