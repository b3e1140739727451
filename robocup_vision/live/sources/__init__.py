"""Sources of frames: cameras and streams, videos, folders of images, recordings; other packages can add theirs."""
