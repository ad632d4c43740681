"""What a policy is once its learning is over: one ONNX file that says what it is for."""
