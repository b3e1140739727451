"""From images to camera and colour files: no chessboard, no slider, no tape measure."""
