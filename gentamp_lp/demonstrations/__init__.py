"""Plans of the training problems, and the states around them: the training data."""
