"""A folder of images in, figures, plots and an HTML report out."""
