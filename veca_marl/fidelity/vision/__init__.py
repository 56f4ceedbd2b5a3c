"""Laws of vision: acuity, disparity, segmentation, defocus."""
