"""What a policy does, why its features were selected, why there is none."""
