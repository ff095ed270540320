"""Truth for the tests: plain loops and closed forms, written without the code that they judge."""
