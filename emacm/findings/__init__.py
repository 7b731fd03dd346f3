"""What is stated about recordings: defects, the range of the training, new spectral lines."""
