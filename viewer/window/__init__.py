"""The window: panel, pointer, and Dear ImGui drawn by moderngl."""
