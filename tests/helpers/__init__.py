"""Help for tests: scenes, comparisons with the reference and models that several of them share."""
