"""What no name fits: where and when a model fails, its shape, how much driving could explain."""
