"""Where methods fail: error maps, the bias of sampled absorption, and the laws with their margins."""
