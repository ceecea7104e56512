"""From a painted albedo to maps of melanin and hemoglobin, by inverting the color LUT."""
