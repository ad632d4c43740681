"""Trained policies: one ONNX file each, with metadata that say what it is for."""
