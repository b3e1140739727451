"""Where frames come from: cameras and streams, videos, folders of images, recordings; other packages add theirs."""
