"""Help for tests: scenes, judges and models that several of them share."""
