"""Camera images by casting rays: scene, mirror camera, sensor."""
