"""OpenCL C sources, spliced and built by lutgen.device."""
