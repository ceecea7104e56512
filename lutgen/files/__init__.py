"""Everything that touches a disk: EXR, pictures, texture maps, folders that are whole or absent, the cache."""
